use super::*;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WIDTH: usize = 8;

/// A descriptor of unit length.
fn descriptor(random: &mut ChaCha8Rng) -> [f32; WIDTH] {
    unit(std::array::from_fn(|_| random.random_range(-1.0..1.0)))
}

fn unit(row: [f32; WIDTH]) -> [f32; WIDTH] {
    let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
    row.map(|value| value / length)
}

/// Frames of `n_rooms` rooms in turn. Each shows 20 of the 40 things of its room, a little changed.
fn frames(n_frames: usize, n_rooms: usize, seed: u64) -> Vec<(Matrix, Origin)> {
    let mut things = ChaCha8Rng::seed_from_u64(5);
    let rooms: Vec<Vec<[f32; WIDTH]>> =
        (0..n_rooms).map(|_| (0..40).map(|_| descriptor(&mut things)).collect()).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut frame = |frame_idx: usize| {
        let room_idx = frame_idx % n_rooms;
        let mut rows = Matrix::new(WIDTH);
        for _ in 0..20 {
            let thing = rooms[room_idx][random.random_range(0..40)];
            rows.push_row(&unit(thing.map(|value| value + random.random_range(-0.1..0.1))));
        }
        (rows, Origin { room_idx, frame_idx })
    };
    (0..n_frames).map(&mut frame).collect()
}

fn config() -> Config {
    Config { n_dimensions: WIDTH, ..Config::default() }
}

fn prepare(frames: &[(Matrix, Origin)], config: &Config) -> Prepared {
    Prepared::new(&frames.iter().map(|(rows, _)| rows).collect::<Vec<_>>(), config, 1).unwrap()
}

/// A memory of the frames of these indices.
fn memory_of(prepared: &Prepared, frames: &[(Matrix, Origin)], idxs: &[usize]) -> Memory {
    let chosen: Vec<(usize, Origin)> = idxs.iter().map(|&idx| (idx, frames[idx].1)).collect();
    prepared.memory(&chosen, 3)
}

fn memory(frames: &[(Matrix, Origin)], config: &Config) -> Memory {
    memory_of(&prepare(frames, config), frames, &(0..frames.len()).collect::<Vec<_>>())
}

fn learned(frames: &[(Matrix, Origin)]) -> Vec<(&Matrix, Origin)> {
    frames.iter().map(|(rows, origin)| (rows, *origin)).collect()
}

/// What the papers say, written down as they say it: the sums of places and of frames in whole numbers.
fn naive_scores(memory: &Memory, descriptors: &Matrix) -> (Vec<i64>, Vec<i64>) {
    let Rows { codes, frame_idxs, .. } = memory.lists.rows();
    let width = memory.coding.n_dimensions();
    let k = memory.config.n_neighbors;
    let (mut of_rooms, mut of_frames) = (vec![0; memory.n_rooms], vec![0; memory.origins.len()]);
    for query in memory.coding.code(descriptors).chunks_exact(width) {
        let distance = |code: &[i8]| -> i64 {
            query.iter().zip(code).map(|(&a, &b)| (i64::from(a) - i64::from(b)).pow(2)).sum()
        };
        let mut found: Vec<(i64, usize)> =
            codes.chunks_exact(width).map(distance).zip(frame_idxs.iter().map(|&idx| idx as usize)).collect();
        found.sort_by_key(|&(distance, _)| distance);
        found.truncate(k + 1);
        let Some((background, _)) = found.pop() else { continue };
        for (room_idx, sum) in of_rooms.iter_mut().enumerate() {
            let of_room = found.iter().filter(|(_, idx)| memory.origins[*idx].room_idx == room_idx);
            *sum += of_room.map(|(distance, _)| background - distance).max().unwrap_or(0);
        }
        for (frame_idx, sum) in of_frames.iter_mut().enumerate() {
            let of_frame = found.iter().filter(|(_, idx)| *idx == frame_idx);
            *sum += of_frame.map(|(distance, _)| background - distance).max().unwrap_or(0);
        }
    }
    (of_rooms, of_frames)
}

/// The scores of a recall as whole sums.
fn whole_scores(memory: &Memory, recall: &Recall, n_descriptors: usize) -> (Vec<i64>, Vec<i64>) {
    let factor = f64::from(memory.coding.scale().powi(2)) * n_descriptors as f64;
    let whole = |score: f32| (f64::from(score) * factor).round() as i64;
    let mut of_frames = vec![0; memory.origins.len()];
    recall.frames.iter().for_each(|frame| of_frames[frame.frame_idx] = whole(frame.votes));
    (recall.room_scores.iter().map(|&score| whole(score)).collect(), of_frames)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn scores_are_those_of_the_papers(n_frames in 1usize..8, n_neighbors in 1usize..12, seed in 0u64..1000) {
        let frames = frames(n_frames, 3, seed);
        let memory = memory(&frames, &Config { n_neighbors, ..config() });
        let query = &self::frames(1, 3, seed + 1)[0].0;
        let recall = memory.recall(query);
        prop_assert_eq!(whole_scores(&memory, &recall, 20), naive_scores(&memory, query));
        // What is told of each match makes up the votes.
        for votes in &recall.frames {
            let of_frame = recall.matches.iter().filter(|found| found.frame_idx == votes.frame_idx);
            let sum: f32 = of_frame.map(|found| found.margin).sum();
            prop_assert!((sum / 20.0 - votes.votes).abs() < 1e-4);
        }
        prop_assert!(recall.frames.is_sorted_by(|a, b| a.votes >= b.votes));
    }

    #[test]
    fn a_search_finds_the_nearest_in_the_lists_it_visits(
        n_rows in 0usize..200, n_words in 1usize..9, n_visited in 1usize..10, n_kept in 1usize..12,
        seed in 0u64..1000,
    ) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Few different numbers: many are as near.
        let mut codes = |n: usize| -> Vec<i8> { (0..n * 4).map(|_| random.random_range(-2..=2)).collect() };
        let words = Words::from_parts(codes(n_words), 4).unwrap();
        let (codes, queries) = (codes(n_rows), codes(5));
        let frame_idxs = (0..n_rows as u32).collect();
        let rows = Rows { words: words.assign(&codes), codes, frame_idxs };
        let lists = Lists::new(&rows, n_words, 4);
        let queries = ByteRows::new(&queries, 4);
        let found = lists.search(&words, &queries, n_visited, n_kept);
        let of_all = lists.search_all(&queries, n_rows.max(1));
        let visited = words.nearest(&queries, n_visited);
        for row_idx in 0..5 {
            let visits: Vec<u32> = visited.of(row_idx).map(|(_, word)| word).collect();
            let is_visited = |&(_, column): &(u32, u32)| visits.contains(&rows.words[lists.frame_idx(column)]);
            let expected: Vec<(u32, u32)> = of_all.of(row_idx).filter(is_visited).take(n_kept).collect();
            prop_assert_eq!(found.of(row_idx).collect::<Vec<_>>(), expected);
        }
        prop_assert_eq!(Lists::new(&lists.rows(), n_words, 4).rows(), lists.rows());
    }
}

#[test]
fn frames_are_answered_by_their_rooms_and_the_frames_like_them() {
    let memory = memory(&frames(30, 3, 1), &config());
    for (rows, origin) in frames(30, 3, 2) {
        let recall = memory.recall(&rows);
        assert_eq!(recall.best_room(), Some(origin.room_idx));
        assert_eq!(memory.origins()[recall.frames[0].frame_idx].room_idx, origin.room_idx);
        assert!(recall.gap() > 0.0 && recall.most_votes() > 0.0);
    }
    let unlike = memory.recall(&frames(5, 5, 3)[4].0);
    let like = memory.recall(&frames(1, 3, 3)[0].0);
    assert!(unlike.mean_nearest > like.mean_nearest && unlike.gap() < like.gap());
}

#[test]
fn few_lists_give_almost_the_answers_of_all() {
    let frames = frames(600, 3, 1);
    let memory = memory(&frames, &config());
    assert_eq!((memory.n_descriptors(), memory.n_lists()), (12_000, 23));
    let queries = self::frames(60, 3, 2);
    let n_same = queries
        .iter()
        .filter(|(rows, _)| memory.recall(rows).best_room() == memory.recall_visiting(rows, 23).best_room())
        .count();
    assert!(n_same >= 59, "{n_same} of 60");
}

#[test]
fn threads_do_not_change_the_memory() {
    let frames = frames(600, 3, 1);
    let with_threads = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| memory(&frames, &config()).to_parts())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn learning_later_and_forgetting_leave_what_would_have_been_learned_at_once() {
    let frames = frames(30, 3, 1);
    let prepared = prepare(&frames, &config());
    let mut memory = memory_of(&prepared, &frames, &(0..12).collect::<Vec<_>>());
    memory.learn(&learned(&frames[12..]), 1);
    assert_eq!(memory.to_parts(), memory_of(&prepared, &frames, &(0..30).collect::<Vec<_>>()).to_parts());
    let but_drive_1: Vec<usize> = (0..6).chain(12..30).collect();
    memory.retain(|origin| !(6..12).contains(&origin.frame_idx));
    assert_eq!(memory.to_parts(), memory_of(&prepared, &frames, &but_drive_1).to_parts());
    memory.retain(|origin| origin.room_idx != 2);
    assert!(memory.origins().iter().all(|origin| origin.room_idx < 2));
    assert_eq!(memory.recall(&frames[2].0).room_scores[2], 0.0);
    memory.renumber(5, |origin| Origin { room_idx: [1, 3, 4][origin.room_idx], ..*origin });
    assert_eq!(memory.recall(&frames[0].0).best_room(), Some(1));
    assert_eq!(memory.n_rooms(), 5);
}

#[test]
fn a_memory_that_outgrew_its_words_makes_new_ones() {
    let frames = frames(1800, 3, 1);
    let first = prepare(&frames[..30], &config());
    let mut grown = memory_of(&first, &frames, &(0..30).collect::<Vec<_>>());
    assert_eq!(grown.n_lists(), 1);
    grown.learn(&learned(&frames[30..]), 1);
    assert_eq!((grown.n_descriptors(), grown.n_lists()), (36_000, 70));
    let right = |(rows, origin): &&(Matrix, Origin)| grown.recall(rows).best_room() == Some(origin.room_idx);
    assert_eq!(self::frames(30, 3, 2).iter().filter(right).count(), 30);
}

#[test]
fn a_full_memory_forgets_the_earlier_of_the_frames_most_alike_in_the_largest_room() {
    let mut frames = frames(900, 3, 1);
    // Frames of room 1 with the numbers 301 and 601 are copies; room 1 alone has one frame more.
    frames[601].0 = frames[301].0.clone();
    frames.push(self::frames(2, 3, 9).remove(1));
    let max_descriptors = 20 * 900;
    let memory = memory(&frames, &Config { max_descriptors, ..config() });
    assert!(memory.n_lists() > 1);
    assert_eq!(memory.n_descriptors(), max_descriptors);
    let kept: Vec<usize> = memory.origins().iter().map(|origin| origin.frame_idx).collect();
    assert!(!kept[..900].contains(&301) && kept.contains(&601));
}

#[test]
fn every_room_keeps_a_frame() {
    let frames = frames(9, 3, 1);
    let tiny = Config { max_descriptors: 25, ..config() };
    let mut memory = memory(&frames, &tiny);
    let rooms =
        |memory: &Memory| -> Vec<usize> { memory.origins().iter().map(|origin| origin.room_idx).collect() };
    assert_eq!((rooms(&memory), memory.n_descriptors()), (vec![0, 1, 2], 60));
    memory.learn(&learned(&frames[..3]), 1);
    assert_eq!((rooms(&memory), memory.n_descriptors()), (vec![0, 1, 2], 60));
}

#[test]
fn memories_of_little_answer() {
    let frames = frames(4, 3, 1);
    let prepared = prepare(&frames, &config());
    let none = memory_of(&prepared, &frames, &[]);
    let recall = none.recall(&frames[0].0);
    assert_eq!((recall.best_room(), recall.best_score(), recall.gap()), (None, 0.0, 0.0));
    assert_eq!((recall.room_scores.len(), recall.mean_nearest), (3, None));

    // One frame is all there is to be like.
    let one = memory_of(&prepared, &frames, &[1]);
    let recall = one.recall(&frames[0].0);
    assert_eq!(recall.best_room(), Some(1));
    assert_eq!(recall.frames.len(), 1);
    assert_eq!(recall.gap(), recall.best_score());

    // A frame that shows nothing says nothing, and harms nothing where it is remembered.
    let recall = one.recall(&Matrix::new(WIDTH));
    assert_eq!((recall.best_room(), recall.mean_nearest, recall.matches.len()), (None, None, 0));
    let mut with_empty = one.clone();
    let empty = (&Matrix::new(0), Origin { room_idx: 0, frame_idx: 9 });
    with_empty.learn(&[empty], 1);
    assert_eq!(with_empty.recall(&frames[0].0), one.recall(&frames[0].0));
    with_empty.retain(|origin| origin.frame_idx == 9);
    assert_eq!(with_empty.n_descriptors(), 0);

    // The same frame in two rooms: neither is nearer.
    let mut twice = one.clone();
    twice.learn(&[(&frames[1].0, Origin { room_idx: 2, frame_idx: 10 })], 1);
    let recall = twice.recall(&frames[1].0);
    assert!(recall.best_score() > 0.0 && recall.gap() == 0.0);
    assert_eq!((recall.best_room(), recall.frames[0].frame_idx), (Some(1), 0));

    // A single descriptor is its own background.
    let mut single = Matrix::new(WIDTH);
    single.push_row(frames[0].0.row(0));
    let mut memory = none.clone();
    memory.learn(&[(&single, frames[0].1)], 1);
    let recall = memory.recall(&single);
    assert_eq!((recall.best_room(), recall.mean_nearest), (None, Some(0.0)));
}

#[test]
fn a_memory_is_what_its_parts_say() {
    let frames = frames(600, 3, 1);
    let memory = memory(&frames, &config());
    let again = Memory::from_parts(memory.to_parts(), &config(), 3).unwrap();
    assert_eq!(again.to_parts(), memory.to_parts());
    assert_eq!(again.recall(&frames[0].0), memory.recall(&frames[0].0));
}

#[test]
fn parts_of_unknown_origin_are_checked() {
    let memory = memory(&frames(9, 3, 1), &config());
    type Damage = (fn(&mut Parts), &'static str);
    let damages: [Damage; 10] = [
        (|parts| parts.scale = f32::NAN, "out of range"),
        (|parts| parts.offsets.truncate(2), "another shape"),
        (|parts| parts.words.truncate(2), "words have another width"),
        (|parts| parts.words.clear(), "words have another width"),
        (|parts| parts.list_lengths.push(0), "as many lists as words"),
        (|parts| parts.list_lengths[0] += 1, "not as many as its lists say"),
        (|parts| parts.list_lengths[0] = usize::MAX, "not as many as its lists say"),
        (|parts| parts.codes.truncate(9), "not as many as its lists say"),
        (|parts| parts.frame_idxs[3] = 9, "frame that there is not"),
        (|parts| parts.origins[3].room_idx = 3, "place that there is not"),
    ];
    for (damage, what) in damages {
        let mut parts = memory.to_parts();
        damage(&mut parts);
        let error = Memory::from_parts(parts, &config(), 3).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
    // Bytes that no coding gives are taken, and answered.
    let mut parts = memory.to_parts();
    parts.codes.fill(-128);
    let odd = Memory::from_parts(parts, &config(), 3).unwrap();
    assert_eq!(odd.recall(&frames(1, 3, 2)[0].0).room_scores.len(), 3);
    let wrong = Config { n_neighbors: 0, ..config() };
    assert!(Memory::from_parts(memory.to_parts(), &wrong, 3).is_err());
}

#[test]
fn parameters_out_of_range_are_named() {
    assert_eq!(config().check(), Ok(()));
    let error = Config { n_dimensions: 257, ..config() }.check().unwrap_err();
    assert_eq!(error, "n_dimensions must be from 1 to 256, not 257");
    assert!(Config { n_visited: 0, ..config() }.check().is_err());
}
