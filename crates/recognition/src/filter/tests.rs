use super::*;
use proptest::prelude::*;
use roomsight_vision::matrix::Matrix;

fn trust(trust: f32) -> Trust {
    trust.try_into().unwrap()
}

/// A frame of a model that cannot tell new places.
fn rooms(probabilities: &[f32]) -> Observation<'_> {
    Observation { probabilities, novelty: None }
}

/// Transitions between `n_rooms` rooms of any kind.
fn any_transitions(n_rooms: usize) -> impl Strategy<Value = Transitions> {
    let dwells = prop::collection::vec(0.5f32..60.0, n_rooms);
    let weights = prop::collection::vec(0.01f32..1.0, n_rooms * n_rooms);
    (dwells, weights).prop_map(move |(dwells, weights)| {
        let mut next = Matrix::from_vec(weights, n_rooms).unwrap();
        for from in 0..n_rooms {
            let row = next.row_mut(from);
            row[from] = 0.0;
            let sum: f32 = row.iter().sum();
            row.iter_mut().for_each(|to| *to /= sum);
        }
        Transitions::from_parts(n_rooms, dwells, next, None).unwrap()
    })
}

fn any_probabilities(n_rooms: usize) -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(prop_oneof![4 => 0.001f32..1.0, 1 => Just(0.0)], n_rooms)
}

/// The matrix of a hidden Markov model in discrete time: a million tiny steps, each so short that at most
/// one change of room falls into it.
fn discrete(transitions: &Transitions, elapsed: f64) -> Vec<Vec<f64>> {
    const N_DOUBLINGS: i32 = 20;
    let n_rooms = transitions.dwells().len();
    let step = elapsed / f64::from(1 << N_DOUBLINGS);
    let entry = |from: usize, to: usize| {
        let leaving = step / f64::from(transitions.dwells()[from]);
        let next = f64::from(transitions.next().row(from)[to]);
        if from == to { 1.0 - leaving } else { leaving * next }
    };
    let mut matrix: Vec<Vec<f64>> =
        (0..n_rooms).map(|from| (0..n_rooms).map(|to| entry(from, to)).collect()).collect();
    for _ in 0..N_DOUBLINGS {
        let old = matrix.clone();
        for (from, row) in matrix.iter_mut().enumerate() {
            for (to, value) in row.iter_mut().enumerate() {
                *value = (0..n_rooms).map(|via| old[from][via] * old[via][to]).sum();
            }
        }
    }
    matrix
}

fn assert_close(found: &[f32], expected: &[f64], tolerance: f64) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((f64::from(*found) - expected).abs() < tolerance, "{found} instead of {expected}");
    }
}

#[test]
fn dwell_and_next_room_are_learned_with_one_visit_more() {
    // Room 0 for 10 s, room 1 for 4 s, room 0 for 6 s and not left. Room 2 is never seen.
    let steps = [(0, 0, 5.0), (0, 1, 5.0), (1, 0, 4.0), (0, 0, 6.0)];
    let steps = steps.map(|(from, to, seconds)| Step { from, to, seconds, meters: None });
    let transitions = Transitions::learn(3, steps);
    // 20 s and 2 departures: the mean is 10 s.
    assert_eq!(transitions.dwells(), [(16.0 + 10.0) / 2.0, (4.0 + 10.0) / 2.0, 10.0]);
    assert_eq!(transitions.next().row(0), [0.0, 0.75, 0.25]);
    assert_eq!(transitions.next().row(1), [0.75, 0.0, 0.25]);
    assert_eq!(transitions.next().row(2), [0.5, 0.5, 0.0]);
}

#[test]
fn where_nothing_was_learned_all_rooms_are_alike() {
    let unlearned = Transitions::unlearned(3);
    assert_eq!(unlearned.dwells(), [20.0; 3]);
    assert_eq!(unlearned.next().row(1), [0.5, 0.0, 0.5]);
    assert_eq!(Transitions::from_parts(3, vec![20.0; 3], unlearned.next().clone(), None).unwrap(), unlearned);
}

#[test]
fn arrays_that_are_no_transitions_are_refused() {
    let next = |values: [f32; 4]| Matrix::from_vec(values.to_vec(), 2).unwrap();
    let refused =
        |dwells: &[f32], values| Transitions::from_parts(2, dwells.to_vec(), next(values), None).err();
    let other = [0.0, 1.0, 1.0, 0.0];
    assert_eq!(refused(&[3.0, 4.0], other), None);
    assert_eq!(refused(&[3.0], other), Some(TransitionsError::Shape { found: 1, expected: 2 }));
    for dwell in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(refused(&[3.0, dwell], other), Some(TransitionsError::Dwell(1)));
    }
    for row in [[0.5, 0.5], [0.5, 0.0], [f32::NAN, 0.0], [2.0, -1.0]] {
        let values = [0.0, 1.0, row[0], row[1]];
        assert_eq!(refused(&[3.0, 4.0], values), Some(TransitionsError::Next(1)), "{row:?}");
    }
}

#[test]
fn a_single_wrong_frame_does_not_change_the_room_but_several_do() {
    let transitions = Transitions::unlearned(3);
    let mut filter = RoomFilter::new(3, trust(0.5));
    let mut answer = |probabilities: [f32; 3]| {
        filter.update(&transitions, 0.2, rooms(&probabilities));
        filter.room_idx()
    };
    (0..10).for_each(|_| assert_eq!(answer([0.8, 0.1, 0.1]), 0));
    assert_eq!(answer([0.1, 0.8, 0.1]), 0);
    assert_eq!(answer([0.8, 0.1, 0.1]), 0);
    let last = (0..10).map(|_| answer([0.1, 0.8, 0.1])).last();
    assert_eq!(last, Some(1));
}

#[test]
fn numbers_that_make_no_sense_do_no_harm() {
    let transitions = Transitions::unlearned(2);
    let mut filter = RoomFilter::new(2, trust(1.0));
    filter.update(&transitions, 0.0, rooms(&[0.9, 0.1]));
    let before = filter.clone();
    for elapsed in [-5.0, f64::NAN, f64::NEG_INFINITY] {
        assert_eq!(filter.update(&transitions, elapsed, rooms(&[0.5, 0.5])), before.belief());
    }
    filter.update(&transitions, 0.0, rooms(&[f32::NAN, f32::NAN]));
    assert_eq!(filter, before);
    filter.update(&transitions, 0.0, rooms(&[f32::INFINITY, f32::NEG_INFINITY]));
    assert!(filter.belief().iter().all(|belief| belief.is_finite()));
    filter.update(&transitions, f64::INFINITY, rooms(&[0.5, 0.5]));
    assert_close(filter.belief(), &[0.5, 0.5], 1e-6);
}

#[test]
fn times_that_make_no_sense_are_learned_as_none_or_long() {
    let learn = |times: [f64; 2]| {
        Transitions::learn(2, times.map(|seconds| Step { from: 0, to: 1, seconds, meters: None }))
            .dwells()
            .to_vec()
    };
    assert_eq!(learn([f64::NAN, 3.0]), learn([0.0, 3.0]));
    assert_eq!(learn([-7.0, 3.0]), learn([0.0, 3.0]));
    assert_eq!(learn([f64::MAX, f64::MAX]), learn([1e9, f64::INFINITY]));
}

#[test]
fn a_robot_that_is_carried_elsewhere_is_unknown_within_a_second_and_known_again_when_it_is_back() {
    const FRAMES_A_SECOND: usize = 5;
    let transitions = Transitions::unlearned(3);
    let mut filter = RoomFilter::new(3, Trust::default());
    let mut is_known_after = |n_frames: usize, novelty: f32| {
        for _ in 0..n_frames {
            let frame = Observation { probabilities: &[0.9, 0.05, 0.05], novelty: Some(novelty) };
            filter.update(&transitions, 1.0 / FRAMES_A_SECOND as f64, frame);
        }
        (filter.is_sure(), filter.novelty().unwrap())
    };
    assert!(is_known_after(300, 0.1).0);
    assert!(is_known_after(1, 0.9).0, "one frame in a doorway");
    assert!(is_known_after(5, 0.1).0);
    let (is_known, novelty) = is_known_after(FRAMES_A_SECOND, 0.95);
    assert!(!is_known && novelty > 0.5, "{novelty}");
    assert!(!is_known_after(300, 0.95).0);
    assert!(is_known_after(FRAMES_A_SECOND, 0.1).0);
}

/// A fifth of a second in which a robot moved so.
fn moved(meters: f64, radians: f64) -> Interval {
    Interval { seconds: 0.2, motion: Some(Motion { meters, radians }) }
}

/// A filter that is sure of the first of three rooms.
fn sure() -> RoomFilter {
    let mut filter = RoomFilter::new(3, Trust::default());
    let frame = Observation { probabilities: &[0.8, 0.1, 0.1], novelty: Some(0.1) };
    (0..20).for_each(|_| _ = filter.update(&Transitions::unlearned(3), 0.2, frame));
    filter
}

#[test]
fn a_robot_that_stands_does_not_drift_to_another_room_and_looks_again_at_what_was_counted() {
    let transitions = Transitions::unlearned(3);
    let after = |since: Interval, n_frames: usize, probabilities: [f32; 3]| {
        let mut filter = sure();
        (0..n_frames).for_each(|_| _ = filter.update(&transitions, since, rooms(&probabilities)));
        (filter.room_idx(), filter.belief()[0])
    };
    // A minute of frames that say nothing.
    let third = [1.0 / 3.0; 3];
    let (by_time, standing) = (after(0.2.into(), 300, third).1, after(moved(0.0, 0.0), 300, third).1);
    assert!(by_time < 0.4 && standing > 0.9, "{by_time}, {standing}");
    // Two seconds of a person before the lens.
    let wrong = [0.2, 0.6, 0.2];
    assert_eq!(after(0.2.into(), 10, wrong).0, 1);
    assert_eq!(after(moved(0.0, 0.0), 10, wrong).0, 0);
    // A robot that was lifted sees it in the end.
    assert_eq!(after(moved(0.0, 0.0), 100, [0.05, 0.9, 0.05]).0, 1);
}

#[test]
fn turning_in_place_shows_more_of_the_room_and_leads_to_no_other() {
    let transitions = Transitions::unlearned(3);
    let mut filter = RoomFilter::new(3, Trust::default());
    let mut turn = |n_frames: usize, probabilities: [f32; 3]| {
        (0..n_frames).for_each(|_| _ = filter.update(&transitions, moved(0.0, 0.3), rooms(&probabilities)));
        filter.belief()[0]
    };
    assert!(turn(10, [0.6, 0.2, 0.2]) > 0.95);
    assert!(turn(100, [1.0 / 3.0; 3]) > 0.95);
}

#[test]
fn the_way_counts_instead_of_time_and_by_the_learned_speed_as_much() {
    let steps = [(0, 1, 10.0, 5.0), (1, 0, 10.0, 5.0)];
    let steps = steps.map(|(from, to, seconds, meters)| Step { from, to, seconds, meters: Some(meters) });
    let transitions = Transitions::learn(2, steps);
    assert_eq!(transitions.learned_speed(), Some(0.5));
    let frame = rooms(&[0.7, 0.3]);
    let (mut by_time, mut by_way) = (RoomFilter::new(2, trust(1.0)), RoomFilter::new(2, trust(1.0)));
    for _ in 0..10 {
        by_time.update(&transitions, 0.4, frame);
        // Twice as fast, in half the time.
        by_way.update(&transitions, moved(0.2, 0.0), frame);
        assert_close(
            by_way.belief(),
            &by_time.belief().iter().copied().map(f64::from).collect::<Vec<_>>(),
            1e-6,
        );
    }
}

#[test]
fn a_jump_lets_go_at_once() {
    let mut filter = sure();
    assert!(filter.is_sure());
    let seen = Observation { probabilities: &[0.3, 0.4, 0.3], novelty: Some(0.1) };
    filter.update(&Transitions::unlearned(3), moved(1.5, 0.0), seen);
    assert_eq!(filter.room_idx(), 0, "so far a robot may drive");
    filter.update(&Transitions::unlearned(3), moved(5.0, 0.0), seen);
    assert!(!filter.is_sure() && filter.room_idx() == 1);
}

#[test]
fn ways_that_make_no_sense_do_no_harm() {
    for motion in [(f64::NAN, f64::NAN), (f64::INFINITY, 0.0), (-3.0, -1.0), (0.0, f64::INFINITY)] {
        let mut filter = sure();
        let seconds = [0.2, f64::NAN, -1.0, f64::INFINITY];
        for seconds in seconds {
            let motion = Some(Motion { meters: motion.0, radians: motion.1 });
            filter.update(&Transitions::unlearned(3), Interval { seconds, motion }, rooms(&[0.5, 0.3, 0.2]));
            let sum: f32 = filter.belief().iter().sum();
            assert!((sum - 1.0).abs() < 1e-5, "{motion:?} in {seconds} s");
            assert!(filter.novelty().is_some_and(f32::is_finite));
        }
    }
}

#[test]
fn frames_in_which_nothing_is_seen_let_time_pass_alone() {
    let transitions = Transitions::unlearned(2);
    let mut filter = RoomFilter::new(2, Trust::default());
    let frame = Observation { probabilities: &[0.9, 0.1], novelty: Some(0.05) };
    (0..20).for_each(|_| _ = filter.update(&transitions, 0.2, frame));
    let before = filter.clone();
    assert_eq!(filter.update(&transitions, 0.0, rooms(&[])), before.belief());
    assert_eq!(filter.novelty(), before.novelty());
    (0..1000).for_each(|_| _ = filter.update(&transitions, 60.0, rooms(&[])));
    assert!(!filter.is_sure());
    let no_number = Observation { probabilities: &[0.9, 0.1], novelty: Some(f32::NAN) };
    filter.update(&transitions, f64::NAN, no_number);
    assert!(filter.novelty().unwrap().is_finite());
}

#[test]
fn a_room_that_was_ruled_out_comes_back() {
    let transitions = Transitions::unlearned(2);
    let mut filter = RoomFilter::new(2, trust(1.0));
    let mut answer_after = |n_frames: usize, probabilities: [f32; 2]| {
        for _ in 0..n_frames {
            filter.update(&transitions, 0.2, rooms(&probabilities));
        }
        filter.room_idx()
    };
    assert_eq!(answer_after(1000, [1.0, 0.0]), 0);
    assert_eq!(answer_after(3, [0.0, 1.0]), 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn agrees_with_the_forward_algorithm_of_a_discrete_model(
        transitions in any_transitions(4),
        frames in prop::collection::vec((0.0f64..90.0, any_probabilities(4)), 1..8),
        power in 0.05f32..3.0,
    ) {
        let mut filter = RoomFilter::new(4, trust(power));
        let mut expected = vec![0.25; 4];
        for (elapsed, probabilities) in &frames {
            let matrix = discrete(&transitions, *elapsed);
            let likelihood = |to: usize| f64::from(probabilities[to].max(MIN_PROBABILITY)).powf(power.into());
            let alpha = |to: usize| (0..4).map(|from| expected[from] * matrix[from][to]).sum::<f64>();
            let joint: Vec<f64> = (0..4).map(|to| likelihood(to) * alpha(to)).collect();
            expected = joint.iter().map(|value| value / joint.iter().sum::<f64>()).collect();
            assert_close(filter.update(&transitions, *elapsed, rooms(probabilities)), &expected, 1e-4);
        }
    }

    #[test]
    fn belief_sums_to_1_and_no_room_is_lost(
        transitions in any_transitions(5),
        frames in prop::collection::vec((0.0f64..1e9, any_probabilities(5)), 1..20),
    ) {
        let mut filter = RoomFilter::new(5, trust(10.0));
        for (elapsed, probabilities) in &frames {
            let belief = filter.update(&transitions, *elapsed, rooms(probabilities));
            prop_assert!((belief.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            prop_assert!(belief.iter().all(|belief| (0.0..=1.0).contains(belief)));
        }
    }

    #[test]
    fn frames_of_no_trust_or_no_keypoints_leave_the_prediction(
        transitions in any_transitions(4), start in any_probabilities(4), frame in any_probabilities(4),
        elapsed in 0.0f64..30.0,
    ) {
        let mut filter = RoomFilter::new(4, trust(1.0));
        filter.update(&transitions, 0.0, rooms(&start));
        let predicted = transitions.predict(filter.belief(), elapsed);
        let mut unseen = filter.clone();
        assert_close(unseen.update(&transitions, elapsed, rooms(&[0.25; 4])), &predicted, 1e-6);
        filter.trust = trust(1e-6);
        assert_close(filter.update(&transitions, elapsed, rooms(&frame)), &predicted, 1e-4);
    }

    #[test]
    fn after_long_the_start_is_forgotten(transitions in any_transitions(4), start in 0usize..4) {
        let mut belief = [0.0; 4];
        belief[start] = 1.0;
        let after = transitions.predict(&belief, 1e7);
        let rate = |room_idx: usize| after[room_idx] / f64::from(transitions.dwells()[room_idx]);
        for to in 0..4 {
            let arriving: f64 =
                (0..4).map(|from| rate(from) * f64::from(transitions.next().row(from)[to])).sum();
            prop_assert!((arriving / rate(to) - 1.0).abs() < 1e-4, "in {arriving}, out {}", rate(to));
        }
    }
}

#[test]
fn where_it_is_after_a_gap_does_not_depend_on_how_often_it_was_asked() {
    for before in [0.0, 0.3, 1.0] {
        let twice = elsewhere(elsewhere(before, 200.0, None, 1.0), 100.0, None, 1.0);
        assert!((twice - elsewhere(before, 300.0, None, 1.0)).abs() < 1e-12);
        let share_of_time = SECONDS_ELSEWHERE / (SECONDS_ELSEWHERE + SECONDS_AMONG_ROOMS);
        assert!((elsewhere(before, 1e9, None, 1.0) - share_of_time).abs() < 1e-12);
    }
}
