use super::super::Network;
use super::super::testing::runtime;
use super::*;
use crate::camera::{Camera, Mask};
use crate::image::Region;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Of a network that takes bytes as they are.
fn as_bytes() -> Input {
    Input {
        name: "image".to_owned(),
        size: size(8, 8),
        multiple_of: None,
        longest_side: None,
        mean: [0.0; 3],
        scale: [1.0; 3],
        order: ColorOrder::Rgb,
    }
}

fn size(width: u32, height: u32) -> Size {
    Size { width, height }
}

fn image(width: usize, height: usize, color: impl Fn(usize, usize) -> [u8; 3]) -> Image {
    let colors: Vec<u8> = (0..width * height).flat_map(|idx| color(idx % width, idx / width)).collect();
    let luma = colors.chunks(3).map(|color| color[1]).collect();
    Image::from_pixels(width, height, luma).unwrap().with_colors(colors).unwrap()
}

/// Smooth in all directions, and without a seam.
fn panorama(width: usize, height: usize, turn: usize) -> Image {
    image(width, height, |x, y| {
        let angle = TAU * ((x + turn) % width) as f32 / width as f32;
        let wave = |n: f32, phase: f32| (128.0 + 100.0 * (n * angle + phase).sin()) as u8;
        [wave(3.0, y as f32 / 9.0), wave(7.0, 1.0), (255 * y / height) as u8]
    })
}

fn view(projection: Projection, image: &Image) -> View {
    Camera::new(projection).view(image.width(), image.height())
}

/// What a frame gives at values from 0 to 255.
fn values(image: &Image, view: &View, around: Around, size: Size) -> Vec<f32> {
    FrameInput::of(image, view, &around, size, &as_bytes()).views().flatten().copied().collect()
}

const WHOLE: Around = Around::Strip { border: 0 };

#[test]
fn colors_are_planes_in_the_order_and_range_that_the_network_wants() {
    let frame = image(2, 1, |x, _| if x == 0 { [10, 20, 30] } else { [110, 120, 130] });
    let view = view(Projection::Perspective, &frame);
    assert_eq!(values(&frame, &view, WHOLE, size(2, 1)), [10.0, 110.0, 20.0, 120.0, 30.0, 130.0]);
    let input =
        Input { mean: [10.0, 20.0, 0.0], scale: [1.0, 2.0, 0.5], order: ColorOrder::Bgr, ..as_bytes() };
    let prepared = FrameInput::of(&frame, &view, &WHOLE, size(2, 1), &input);
    assert_eq!(prepared.views().next().unwrap(), [15.0, 65.0, 0.0, 200.0, 0.0, 100.0]);
    let gray = Image::from_pixels(2, 1, vec![7, 9]).unwrap();
    assert_eq!(values(&gray, &view, WHOLE, size(2, 1)), [7.0, 9.0, 7.0, 9.0, 7.0, 9.0]);
}

#[test]
fn perspective_frames_are_squeezed_and_averaged() {
    let frame = image(40, 20, |x, y| [(6 * x) as u8, (12 * y) as u8, 50]);
    let view = view(Projection::Perspective, &frame);
    let prepared = FrameInput::of(&frame, &view, &Around::Views { n: 8 }, size(10, 10), &as_bytes());
    assert_eq!(prepared.views().len(), 1);
    let [red, green, blue] = [0, 1, 2].map(|plane| &prepared.views().next().unwrap()[100 * plane..][..100]);
    for (x, y) in [(1, 1), (4, 7), (8, 3)] {
        let [frame_x, frame_y] = prepared.place(0, [x as f32, y as f32]).unwrap();
        assert_eq!([frame_x, frame_y], [4.0 * x as f32 + 1.5, 2.0 * y as f32 + 0.5]);
        assert!((red[10 * y + x] - 6.0 * frame_x).abs() <= 1.0 && blue[10 * y + x] == 50.0);
        assert!((green[10 * y + x] - 12.0 * frame_y).abs() <= 1.0);
    }
}

#[test]
fn places_of_an_enlarged_frame_lie_in_it() {
    let frame = image(5, 4, |_, _| [1, 2, 3]);
    let view = view(Projection::Perspective, &frame);
    let prepared = FrameInput::of(&frame, &view, &WHOLE, size(20, 20), &as_bytes());
    assert_eq!(prepared.place(0, [0.0, 0.0]), Some([0.0, 0.0]));
    assert_eq!(prepared.place(0, [19.0, 19.0]), Some([4.0, 3.0]));
}

#[test]
fn views_of_a_turned_panorama_are_the_same_views_turned() {
    let upright = panorama(128, 64, 0);
    let view = view(Projection::Equirectangular, &upright);
    let views = |image: &Image| values(image, &view, Around::Views { n: 8 }, size(24, 24));
    let n_values = 3 * 24 * 24;
    // By three of eight views.
    let turned = views(&panorama(128, 64, 48));
    let upright = views(&upright);
    assert!(turned[..5 * n_values] == upright[3 * n_values..]);
    assert!(turned[5 * n_values..] == upright[..3 * n_values]);
    assert!(turned != upright);
}

#[test]
fn a_strip_goes_on_beyond_the_edges() {
    let upright = panorama(128, 64, 0);
    let view = view(Projection::Equirectangular, &upright);
    let around = Around::Strip { border: 16 };
    let strip = values(&upright, &view, around, size(96, 32));
    for row in strip.chunks(96) {
        assert_eq!(row[16..32], row[80..]);
        assert_eq!(row[64..80], row[..16]);
    }
    // A quarter of a turn.
    let turned = values(&panorama(128, 64, 32), &view, around, size(96, 32));
    for (row, turned) in strip.chunks(96).zip(turned.chunks(96)) {
        assert_eq!(row[16 + 16..80], turned[16..80 - 16]);
    }
}

proptest! {
    #[test]
    fn turning_a_panorama_moves_places_alone(turn in 0usize..128, border in 0u32..24, x in 0u8..96, y in 0u8..32) {
        let (upright, turned) = (panorama(128, 64, 0), panorama(128, 64, turn));
        let view = view(Projection::Equirectangular, &upright);
        let prepared = FrameInput::of(&upright, &view, &Around::Strip { border }, size(96, 32), &as_bytes());
        let position = [f32::from(x), f32::from(y)];
        let is_repeated = u32::from(x) < border || u32::from(x) >= 96 - border;
        let Some(place) = prepared.place(0, position) else {
            prop_assert!(is_repeated);
            return Ok(());
        };
        prop_assert!(!is_repeated);
        // The color there, found in the turned panorama by its place.
        let column = ((place[0].round() as usize + 128 - turn) % 128).min(127);
        let pixel = 3 * (place[1].round() as usize * 128 + column);
        let expected = &turned.colors().unwrap()[pixel..pixel + 3];
        let idx = usize::from(y) * 96 + usize::from(x);
        for (color, &expected) in expected.iter().enumerate() {
            let value = prepared.views().next().unwrap()[color * 96 * 32 + idx];
            prop_assert!((value - f32::from(expected)).abs() < 32.0, "{value} {expected}");
        }
    }
}

#[test]
fn what_is_hidden_becomes_the_mean_color() {
    let frame = image(16, 16, |x, _| if x < 8 { [200, 0, 0] } else { [0, 100, 40] });
    let left_hidden = Image::from_pixels(2, 1, vec![0, 255]).unwrap();
    let camera = Camera { projection: Projection::Perspective, mask: Some(Mask::new(left_hidden)) };
    let masked = camera.view(16, 16);
    let [red, green, blue] =
        [0, 1, 2].map(|plane| values(&frame, &masked, WHOLE, size(8, 8))[64 * plane..][..64].to_vec());
    assert!(red.iter().all(|&red| red == 0.0) && green.iter().all(|&green| green == 100.0));
    assert!(blue.iter().all(|&blue| blue == 40.0));
    let prepared = FrameInput::of(&frame, &masked, &WHOLE, size(8, 8), &as_bytes());
    assert_eq!((prepared.place(0, [2.0, 2.0]), prepared.place(0, [5.0, 2.0])), (None, Some([10.5, 4.5])));
    // Rows that did not arrive.
    let visible = Region { left: 0, top: 0, right: 16, bottom: 8 };
    let cut = view(Projection::Perspective, &frame).within(visible);
    let whole = values(&frame, &cut, WHOLE, size(8, 8));
    assert_eq!((whole[0], whole[7], whole[8 * 7]), (200.0, 0.0, 100.0));
    let none = view(Projection::Perspective, &frame).within(Region { bottom: 0, ..visible });
    assert!(values(&frame, &none, WHOLE, size(8, 8)).iter().all(|&value| value == 128.0));
}

#[test]
fn mirrors_are_unrolled_from_the_rim_inward() {
    let mirror = Mirror { center_x: 0.5, center_y: 0.375, inner_radius: 0.1, outer_radius: 0.3 };
    // Color by direction and distance from the center (100, 75) of a frame of 200 x 150.
    let frame = image(200, 150, |x, y| {
        let (dx, dy, radius) = mirror.polar(x as f32, y as f32, 200);
        [
            (128.0 + 100.0 * dx / radius.max(1.0)) as u8,
            (128.0 + 100.0 * dy / radius.max(1.0)) as u8,
            radius as u8,
        ]
    });
    let view = view(Projection::Omnidirectional(mirror), &frame);
    let prepared = FrameInput::of(&frame, &view, &WHOLE, size(64, 16), &as_bytes());
    let strip = prepared.views().next().unwrap();
    for (x, y) in [(0, 0), (15, 3), (40, 15), (63, 8)] {
        let [frame_x, frame_y] = prepared.place(0, [x as f32, y as f32]).unwrap();
        let (_, _, radius) = mirror.polar(frame_x, frame_y, 200);
        assert!((radius - (60.0 - 40.0 * (y as f32 + 0.5) / 16.0)).abs() < 0.1, "{radius}");
        let angle = TAU * (x as f32 + 0.5) / 64.0;
        let expected = [128.0 + 100.0 * angle.cos(), 128.0 + 100.0 * angle.sin(), radius];
        for (color, expected) in expected.into_iter().enumerate() {
            let value = strip[color * 64 * 16 + y * 64 + x];
            assert!((value - expected).abs() < 4.0, "{x} {y}: {value} instead of {expected}");
        }
    }
    let views = FrameInput::of(&frame, &view, &Around::Views { n: 4 }, size(16, 16), &as_bytes());
    assert_eq!(views.views().len(), 4);
    let opposite = views.place(2, [7.5, 7.5]).unwrap();
    let first = views.place(0, [7.5, 7.5]).unwrap();
    assert!((first[0] + opposite[0] - 200.0).abs() < 1.0 && (first[1] + opposite[1] - 150.0).abs() < 1.0);
}

#[test]
fn a_mirror_that_leaves_the_frame_shows_nothing_there() {
    let mirror = Mirror { center_x: 0.0, center_y: 0.0, inner_radius: 0.5, outer_radius: 4.0 };
    let frame = image(40, 30, |_, _| [9, 9, 9]);
    let view = view(Projection::Omnidirectional(mirror), &frame);
    let prepared = FrameInput::of(&frame, &view, &WHOLE, size(32, 32), &as_bytes());
    assert!(prepared.views().flatten().all(|&value| value == 9.0));
    assert_eq!(prepared.place(0, [20.0, 31.0]), None);
}

#[test]
fn keypoints_of_a_strip_come_back_to_the_frame() {
    let frame = panorama(128, 64, 0);
    let view = view(Projection::Equirectangular, &frame);
    let prepared = FrameInput::of(&frame, &view, &Around::Strip { border: 16 }, size(96, 32), &as_bytes());
    let keypoints = [3.0, 16.5, 80.0].map(|x| Keypoint::new(x, 7.5, 1.0));
    let rows = Matrix::from_vec(vec![1.0, 2.0, 3.0], 1).unwrap();
    let (placed, kept) = prepared.to_frame(0, &keypoints, &rows);
    assert_eq!(kept.as_slice(), [2.0]);
    assert_eq!((placed[0].x, placed[0].y, placed[0].scale), (1.5, 15.5, 2.0));
}

#[test]
fn layouts_that_cannot_be_are_refused() {
    assert!(Around::Views { n: 0 }.check(size(8, 8)).unwrap_err().contains("1 to 64"));
    assert!(Around::Strip { border: 3 }.check(size(8, 8)).unwrap_err().contains("quarter"));
    assert_eq!(Around::Strip { border: 2 }.check(size(8, 8)), Ok(()));
}

/// A room all around: walls between a floor and a ceiling, on one side in blocks of color, on the other white.
fn room(turn: usize) -> Image {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let blocks: Vec<[u8; 3]> = (0..32 * 8).map(|_| random.random()).collect();
    image(512, 256, |x, y| {
        let (x, is_wall) = ((x + turn) % 512, (64..192).contains(&y));
        match is_wall {
            true if x < 256 => blocks[x / 16 * 8 + (y - 64) / 16],
            true => [230; 3],
            false => [y as u8; 3],
        }
    })
}

#[test]
fn turning_a_panorama_hardly_changes_what_a_network_says() {
    /// The least cosine between the vectors of a panorama and of the same turned.
    const TOLERANCE: f32 = 0.99;
    let Some(runtime) = runtime("turning a panorama before a network") else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../networks");
    let network = Network::open(&folder.join("efficientnet-lite0.onnx")).unwrap();
    for (around, size) in [
        (Around::Views { n: 8 }, network.description().input.size),
        (Around::Strip { border: 32 }, size(640, 256)),
    ] {
        let mut session = network.session(&runtime, size).unwrap();
        let mut vector = |image: &Image| {
            let view = view(Projection::Equirectangular, image);
            let prepared = FrameInput::of(image, &view, &around, size, &network.description().input);
            let vectors: Vec<Vec<f32>> =
                prepared.views().map(|view| session.run(view).unwrap().vector().unwrap()).collect();
            (0..vectors[0].len())
                .map(|idx| vectors.iter().map(|vector| vector[idx]).sum())
                .collect::<Vec<f32>>()
        };
        let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        let cosine = |a: &[f32], b: &[f32]| product(a, b) / (product(a, a) * product(b, b)).sqrt();
        let upright = vector(&room(0));
        // By half of what lies between two views, and by more.
        for turn in [32, 100, 200] {
            let turned = cosine(&upright, &vector(&room(turn)));
            assert!(turned >= TOLERANCE, "{around:?}, {turn}: {turned}");
        }
        let other = cosine(&upright, &vector(&panorama(512, 256, 0)));
        assert!(other < 0.9, "{around:?}, {other}: the network tells nothing apart");
    }
}
