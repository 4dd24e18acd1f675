//! What holds for whole sequences; small frames keep it quick.

mod senses;

use super::*;
use roomsight_vision::image::{Image, Limits};
use std::collections::BTreeSet;
use std::fs;
use std::sync::OnceLock;

const SMALL: [usize; 2] = [64, 48];

fn spec(illumination: Illumination, run: u32) -> SequenceSpec {
    SequenceSpec {
        lab: Lab::Saarbruecken,
        part: Part::B,
        route: Route::Standard,
        illumination,
        run,
        seed: 0,
        frames_per_second: 5.0,
        has_stops: false,
    }
}

fn small(spec: &SequenceSpec) -> Simulation {
    Simulation::with_size(spec, SMALL).unwrap()
}

/// One simulation for all tests that do not care which.
fn any() -> &'static Simulation {
    static SIMULATION: OnceLock<Simulation> = OnceLock::new();
    SIMULATION.get_or_init(|| small(&spec(Illumination::Cloudy, 1)))
}

fn mean(frame: &RgbImage) -> f32 {
    frame.as_raw().iter().map(|&value| f32::from(value)).sum::<f32>() / frame.as_raw().len() as f32
}

#[test]
fn frames_are_the_same_bytes_for_any_number_of_threads() {
    let frames = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let simulation = small(&spec(Illumination::Sunny, 1));
            [20, 150].map(|frame_idx| {
                CameraKind::ALL.iter().map(|&kind| simulation.render(frame_idx, kind)).collect()
            })
        })
    };
    let one: [Vec<RgbImage>; 2] = frames(1);
    assert!(one == frames(3));
}

#[test]
fn a_standard_path_is_about_as_long_as_those_of_cold_and_driven_at_its_speed() {
    let simulation = any();
    assert!((300..=900).contains(&simulation.n_frames()), "{}", simulation.n_frames());
    for frame_idx in 1..simulation.n_frames() {
        let [before, after] = [frame_idx - 1, frame_idx].map(|idx| simulation.pose(idx));
        let speed = (after.x - before.x).hypot(after.y - before.y) * 5.0;
        // A chord is a little shorter than the curve.
        assert!(speed <= SPEED + 1e-3 && speed > 0.9 * SPEED, "frame {frame_idx}: {speed} m/s");
        assert!(after.heading > -std::f32::consts::PI - 1e-6 && after.heading <= std::f32::consts::PI + 1e-6);
    }
}

#[test]
fn every_frame_is_labeled_by_the_room_that_it_was_taken_in() {
    let simulation = any();
    let mut places = BTreeSet::new();
    for frame_idx in 0..simulation.n_frames() {
        let Pose { x, y, .. } = simulation.pose(frame_idx);
        let place = simulation.place(frame_idx);
        let room = simulation.scene.plan().rooms.iter().find(|room| room.label == place).unwrap();
        assert!(room.rect.contains(x, y), "frame {frame_idx} at ({x}, {y}) is not in {place}");
        places.insert(place.to_owned());
    }
    assert_eq!(places.into_iter().collect::<Vec<_>>(), ["1PO-B", "CR-B", "PA-B", "TL-B"]);
}

#[test]
fn the_label_changes_where_the_border_is_near() {
    let simulation = any();
    let changes: Vec<usize> = (1..simulation.n_frames())
        .filter(|&frame_idx| simulation.place(frame_idx) != simulation.place(frame_idx - 1))
        .collect();
    assert_eq!(changes.len(), 6, "into three rooms and out again");
    for frame_idx in changes {
        assert!(simulation.border_distance(frame_idx) < 0.07);
    }
    assert!((0..simulation.n_frames()).any(|frame_idx| simulation.border_distance(frame_idx) > 1.0));
}

#[test]
fn other_runs_and_other_light_drive_differently_through_the_same_lab() {
    let (first, second) = (any(), small(&spec(Illumination::Cloudy, 2)));
    let night = small(&spec(Illumination::Night, 1));
    assert_eq!(first.scene.plan(), second.scene.plan());
    assert_eq!(first.scene.plan(), night.scene.plan());
    for other in [&second, &night] {
        assert_ne!(first.pose(30), other.pose(30));
        assert_ne!(first.render(30, CameraKind::Perspective), other.render(30, CameraKind::Perspective));
    }
}

#[test]
fn labs_parts_and_seeds_have_different_plans() {
    let plan = |lab: Lab, part: Part, seed: u64| {
        let spec = SequenceSpec { lab, part, seed, ..spec(Illumination::Cloudy, 1) };
        Plan::draw(lab, part, &mut seeded(&spec.lab_key()))
    };
    let plans = [
        plan(Lab::Freiburg, Part::B, 0),
        plan(Lab::Saarbruecken, Part::B, 0),
        plan(Lab::Saarbruecken, Part::A, 0),
        plan(Lab::Saarbruecken, Part::B, 1),
    ];
    for (idx, plan) in plans.iter().enumerate() {
        assert!(plans[..idx].iter().all(|other| other.rooms[1].rect != plan.rooms[1].rect));
    }
}

#[test]
fn windows_are_bright_by_day_and_dark_at_night() {
    // From one end of the corridor to the window at the other, by several rays: some meet its bars, some
    // the lights of the town.
    let window = |illumination: Illumination| {
        let simulation = small(&spec(illumination, 1));
        let origin = vec3(simulation.pose(0).x, 0.0, 1.3);
        let rays = (0..12).map(|idx| {
            let direction = vec3(1.0, 0.008 + 0.002 * idx as f32, 0.004 * (idx % 4) as f32).normalized();
            simulation.scene.radiance(&Ray { origin, direction, spread: 0.003 }, None).mean()
        });
        rays.sum::<f32>() / 12.0
    };
    assert!(window(Illumination::Cloudy) > 1.0);
    assert!(window(Illumination::Sunny) > window(Illumination::Cloudy));
    assert!(window(Illumination::Night) < 0.1 * window(Illumination::Cloudy));
}

#[test]
fn the_automatic_exposure_brings_every_light_to_a_middling_brightness() {
    for &illumination in Illumination::ALL {
        let simulation = small(&spec(illumination, 1));
        for frame_idx in [10, 120, 300] {
            let brightness = mean(&simulation.render(frame_idx, CameraKind::Perspective));
            assert!((50.0..200.0).contains(&brightness), "{illumination:?} {frame_idx}: {brightness}");
        }
    }
}

#[test]
fn an_impossible_frame_rate_is_refused() {
    for frames_per_second in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let wrong = SequenceSpec { frames_per_second, ..spec(Illumination::Cloudy, 1) };
        assert!(matches!(Simulation::new(&wrong), Err(SimulateError::FrameRate(_))));
    }
}

#[test]
fn a_sequence_on_disk_has_the_layout_of_cold() {
    let root = tempfile::tempdir().unwrap();
    let sparse = SequenceSpec { frames_per_second: 0.1, ..spec(Illumination::Night, 2) };
    let simulation = small(&sparse);
    let n_written = std::sync::atomic::AtomicUsize::new(0);
    let count = |n: usize| {
        n_written.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
    };
    let summary = simulation.write(CameraKind::ALL, root.path(), &count).unwrap();
    assert_eq!(summary.folder, root.path().join("cold-saarbruecken/part_b/seq3_night2"));
    assert_eq!(n_written.into_inner(), 2 * summary.n_frames);

    let labels = fs::read_to_string(summary.folder.join("localization/places.lst")).unwrap();
    assert_eq!(labels.lines().count(), summary.n_frames);
    let mut last_time = 0.0;
    for (frame_idx, line) in labels.lines().enumerate() {
        let (name, place) = line.split_once(' ').unwrap();
        assert_eq!(place, simulation.place(frame_idx));
        let fields: Vec<&str> = name.strip_suffix(".jpeg").unwrap().split('_').collect();
        let number = |field: &str, letter: char| field.strip_prefix(letter).unwrap().parse::<f64>().unwrap();
        let time = number(fields[0], 't');
        assert!(frame_idx == 0 || (time - last_time - 10.0).abs() < 1e-3, "{time} after {last_time}");
        last_time = time;
        assert!((number(fields[1], 'x') - f64::from(simulation.pose(frame_idx).x)).abs() < 1e-5);
        for camera in ["std_cam", "omni_cam"] {
            let jpeg = fs::read(summary.folder.join(camera).join(name)).unwrap();
            let frame = Image::decode(&jpeg, &Limits::default()).unwrap();
            assert_eq!([frame.width(), frame.height()], SMALL);
        }
    }
}

#[test]
fn walls_have_gaps_where_the_robot_drives_and_come_back_from_their_file() {
    let simulation = any();
    let walls = simulation.walls();
    for frame_idx in 1..simulation.n_frames() {
        let [before, after] = [frame_idx - 1, frame_idx].map(|idx| simulation.pose(idx));
        for Wall { from, to } in &walls {
            // All walls run along an axis: the way crosses one where its ends are on both sides.
            let [across, along] = if from[1] == to[1] { [1, 0] } else { [0, 1] };
            let [a, b] = [[before.x, before.y], [after.x, after.y]];
            let crosses = (a[across] - from[across]) * (b[across] - from[across]) < 0.0;
            let is_there = from[along].min(to[along]) < a[along] && a[along] < from[along].max(to[along]);
            assert!(!(crosses && is_there), "frame {frame_idx} goes through {from:?} to {to:?}");
        }
    }
    // Four sides a room at least, and a door more each.
    assert!(walls.len() > 4 * simulation.scene.plan().rooms.len(), "{}", walls.len());

    let folder = tempfile::tempdir().unwrap();
    assert!(Wall::read(folder.path()).is_empty());
    fs::create_dir(folder.path().join("localization")).unwrap();
    let text = Wall::to_csv(&walls) + "1,2,3\n1,2,3,inf\nabc\n";
    fs::write(folder.path().join(walls::WALLS_FILE), text).unwrap();
    let read = Wall::read(folder.path());
    assert_eq!(read.len(), walls.len());
    let far = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    assert!(read.iter().zip(&walls).all(|(a, b)| far(a.from, b.from) < 1e-3 && far(a.to, b.to) < 1e-3));
}

#[test]
fn a_sequence_is_kept_when_it_is_the_same_and_replaced_when_it_is_not() {
    let root = tempfile::tempdir().unwrap();
    let sparse = SequenceSpec { frames_per_second: 0.05, ..spec(Illumination::Night, 2) };
    let write =
        |spec: &SequenceSpec| small(spec).write(&[CameraKind::Perspective], root.path(), &|_| ()).unwrap();
    let first = write(&sparse);
    assert!(!first.was_kept && write(&sparse).was_kept);
    let marker = root.path().join("SIMULATED.txt");
    let of_other_code =
        fs::read_to_string(&marker).unwrap().replace(env!("ROOMSIGHT_SIMULATION_SOURCES"), "0");
    fs::write(&marker, of_other_code).unwrap();
    assert!(!write(&sparse).was_kept && write(&sparse).was_kept);
    let other = write(&SequenceSpec { frames_per_second: 0.04, ..sparse });
    assert!(!other.was_kept && other.n_frames < first.n_frames);
    let n_files = fs::read_dir(other.folder.join("std_cam")).unwrap().count();
    assert_eq!(n_files, other.n_frames, "nothing of the first is left");
    let marker = fs::read_to_string(marker).unwrap();
    assert_eq!(marker.matches("seq3_night2").count(), 1, "{marker}");
}

#[test]
fn a_folder_with_foreign_files_is_left_alone() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("thesis.txt"), "mine").unwrap();
    let sparse = SequenceSpec { frames_per_second: 0.05, ..spec(Illumination::Night, 2) };
    let refused = small(&sparse).write(CameraKind::ALL, root.path(), &|_| ());
    assert!(matches!(refused, Err(SimulateError::ForeignFolder(_))));
    assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
}

#[test]
fn nothing_stands_where_the_robot_drives() {
    for (&lab, &part) in Lab::ALL.iter().flat_map(|lab| Part::ALL.iter().map(move |part| (lab, part))) {
        let simulation =
            small(&SequenceSpec { lab, part, route: Route::Extended, ..spec(Illumination::Night, 1) });
        for frame_idx in (0..simulation.n_frames()).step_by(3) {
            let Pose { x, y, .. } = simulation.pose(frame_idx);
            for (height, direction) in [0.3, 0.7, 1.1].into_iter().flat_map(|h| (0..8).map(move |d| (h, d))) {
                let (sin, cos) = (0.1 + direction as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
                let inside = vec3(x, y, height);
                let outline = inside + vec3(cos, sin, 0.01) * 0.22;
                let place = simulation.place(frame_idx);
                assert!(
                    simulation.scene.is_clear(inside, outline),
                    "{lab:?} {part:?} at ({x}, {y}) in {place}"
                );
            }
        }
    }
}
