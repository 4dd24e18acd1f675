use super::super::{Image, ImageError, Limits};
use crate::simd::luma_of;
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, GrayImage, ImageEncoder, Luma};
use proptest::prelude::*;

/// The small pictures that `tests/pictures/small.py` writes.
macro_rules! small {
    ($name:literal) => {
        include_bytes!(concat!("../../../tests/pictures/", $name, ".jpg")).as_slice()
    };
}

const TOGETHER: &[u8] = small!("together");
const RESTARTS: &[u8] = small!("restarts");
const PROGRESSIVE: &[u8] = small!("progressive");
const ALL: [&[u8]; 10] = [
    TOGETHER,
    RESTARTS,
    PROGRESSIVE,
    small!("apart"),
    small!("upright-together"),
    small!("upright-apart"),
    small!("full"),
    small!("full-without-tables"),
    small!("dense-chroma"),
    small!("inks"),
];

fn decoded(bytes: &[u8]) -> Image {
    Image::decode(bytes, &Limits::default()).unwrap()
}

fn refusal(bytes: &[u8]) -> ImageError {
    Image::decode(bytes, &Limits::default()).unwrap_err()
}

fn decoded_with_colors(bytes: &[u8]) -> Image {
    Image::decode_with_colors(bytes, &Limits::default()).unwrap()
}

/// Where a marker begins.
fn marker(bytes: &[u8], kind: u8) -> usize {
    bytes.windows(2).position(|pair| pair == [0xFF, kind]).unwrap()
}

/// Checks that everything in the visible region is as in the whole picture, and gray fills the rest.
fn check_visible(cut: &Image, whole: &Image) {
    let visible = cut.visible().unwrap();
    assert_eq!((visible.left, visible.right), (0, whole.width()));
    for y in visible.top..visible.bottom {
        assert_eq!(cut.row(y), whole.row(y), "row {y}");
    }
    assert!(visible.bottom - visible.top >= whole.height() / 3);
}

#[test]
fn the_order_of_scans_changes_nothing() {
    assert_eq!(decoded(TOGETHER), decoded(small!("apart")));
    assert_eq!(decoded(small!("upright-together")), decoded(small!("upright-apart")));
    assert_eq!(decoded(TOGETHER), decoded(RESTARTS));
}

#[test]
fn components_of_one_id_are_taken_in_their_order() {
    let mut bytes = TOGETHER.to_vec();
    let (frame, scan) = (marker(&bytes, 0xC0) + 10, marker(&bytes, 0xDA) + 5);
    for idx in 0..3 {
        (bytes[frame + 3 * idx], bytes[scan + 2 * idx]) = (1, 1);
    }
    assert_eq!(decoded(&bytes), decoded(TOGETHER));
}

#[test]
fn tables_that_did_not_come_are_the_standard_ones() {
    assert_eq!(decoded(small!("full")), decoded(small!("full-without-tables")));
}

#[test]
fn luma_with_fewer_samples_than_chroma_fills_the_frame() {
    let image = decoded(small!("dense-chroma"));
    assert_eq!((image.width(), image.height()), (33, 19));
    let last_column: Vec<u8> = (0..19).map(|y| image.row(y)[32]).collect();
    assert!(last_column.iter().any(|&luma| luma != last_column[0]));
}

#[test]
fn missing_rows_are_gray_and_told_or_refused() {
    for whole_bytes in [TOGETHER, RESTARTS, small!("apart"), small!("full")] {
        let whole = decoded(whole_bytes);
        let mut n_told = 0;
        for length in 0..whole_bytes.len() {
            for end in [&b""[..], b"\xFF\xD9"] {
                let cut = [&whole_bytes[..length], end].concat();
                match Image::decode(&cut, &Limits::default()) {
                    Ok(image) if image.damaged_rows() == 0 => assert_eq!(image, whole, "{length}"),
                    Ok(image) => {
                        n_told += 1;
                        assert!(image.damaged_rows() <= whole.height() * 2 / 3);
                        check_visible(&image, &whole);
                        assert_eq!(image.row(whole.height() - 1).last(), Some(&128));
                    }
                    Err(ImageError::Damaged(_) | ImageError::UnknownFormat) => {}
                    Err(other) => panic!("{length}: {other}"),
                }
            }
        }
        assert!(n_told > 100, "{n_told}");
    }
}

#[test]
fn a_progressive_frame_that_breaks_off_is_told() {
    let whole = decoded(PROGRESSIVE);
    let cut = &PROGRESSIVE[..PROGRESSIVE.len() * 9 / 10];
    // How many scans were to come is not known without the marker of the end.
    assert_eq!(decoded(cut).damaged_rows(), 60);
    let image = decoded(&[cut, b"\xFF\xD9"].concat());
    assert!(image.damaged_rows() > 0 && image.damaged_rows() < 60);
    // All of it was sent once, so that all is to be seen.
    assert_eq!(image.visible().unwrap().bottom, 60);
    assert_eq!(image.row(0), whole.row(0));
    assert!(matches!(refusal(&PROGRESSIVE[..marker(PROGRESSIVE, 0xDA) + 20]), ImageError::Damaged(_)));
}

#[test]
fn a_lost_interval_costs_its_rows_alone() {
    // Groups of 16 x 16 pixels, five in a row: the last interval but one holds the last row's second and third.
    let restarts: Vec<usize> = (0..RESTARTS.len() - 1)
        .filter(|&at| RESTARTS[at] == 0xFF && (0xD0..=0xD7).contains(&RESTARTS[at + 1]))
        .collect();
    let (start, end) = (restarts[restarts.len() - 2], restarts[restarts.len() - 1]);
    let lost = [&RESTARTS[..start], &RESTARTS[end..]].concat();
    let image = decoded(&lost);
    check_visible(&image, &decoded(RESTARTS));
    let (row, whole) = (image.row(59), decoded(RESTARTS));
    assert_eq!(row[16..48], [128; 32]);
    assert_eq!((&row[..16], &row[48..]), (&whole.row(59)[..16], &whole.row(59)[48..]));
}

#[test]
fn markers_nobody_announced_end_the_picture() {
    let interval = marker(RESTARTS, 0xDD);
    let unannounced = [&RESTARTS[..interval], &RESTARTS[interval + 6..]].concat();
    assert!(refusal(&unannounced).to_string().contains("rows only"), "{}", refusal(&unannounced));
}

#[test]
fn what_is_not_read_is_named() {
    let with_frame = |kind: u8, precision: u8| {
        let mut bytes = TOGETHER.to_vec();
        let frame = marker(TOGETHER, 0xC0);
        (bytes[frame + 1], bytes[frame + 4]) = (kind, precision);
        bytes
    };
    for (bytes, name) in [
        (with_frame(0xC9, 8), "arithmetic"),
        (with_frame(0xC3, 8), "lossless"),
        (with_frame(0xC1, 12), "12 bits"),
        (with_frame(0xC7, 8), "hierarchical"),
    ] {
        let refusal = refusal(&bytes);
        assert!(
            matches!(&refusal, ImageError::Unsupported { format, .. } if format.contains(name)),
            "{refusal}"
        );
    }
}

#[test]
fn nothing_may_come_twice() {
    let scan = marker(TOGETHER, 0xDA);
    let twice = [&TOGETHER[..TOGETHER.len() - 2], &TOGETHER[scan..]].concat();
    assert_eq!(decoded(&twice), decoded(TOGETHER), "what follows a whole picture is of no interest");
    let scan = marker(PROGRESSIVE, 0xDA);
    let twice = [&PROGRESSIVE[..PROGRESSIVE.len() - 2], &PROGRESSIVE[scan..]].concat();
    assert!(refusal(&twice).to_string().contains("follow each other"));
}

#[test]
fn colors_are_those_of_the_chroma_planes() {
    for bytes in ALL {
        let (plain, colored) = (decoded(bytes), decoded_with_colors(bytes));
        assert_eq!((plain.colors(), plain.pixels()), (None, colored.pixels()));
        let colors = colored.colors().unwrap().as_chunks().0;
        let is_colored = |&[red, green, blue]: &[u8; 3]| red.abs_diff(green).max(green.abs_diff(blue)) > 40;
        assert!(colors.iter().any(is_colored));
        for (&[red, green, blue], &luma) in colors.iter().zip(plain.pixels()) {
            let is_within = [red, green, blue].iter().all(|&value| (1..255).contains(&value));
            assert!(!is_within || luma_of([red, green, blue]).abs_diff(luma) <= 1);
        }
    }
    assert_eq!(decoded_with_colors(TOGETHER), decoded_with_colors(small!("apart")));
    assert_eq!(decoded_with_colors(&large()).colors(), None, "gray");
}

#[test]
fn colors_that_do_not_come_are_done_without() {
    let apart = small!("apart");
    let scans: Vec<usize> =
        (0..apart.len() - 1).filter(|&at| apart[at..].starts_with(&[0xFF, 0xDA])).collect();
    let whole = decoded_with_colors(apart);
    // Without the last scan, with a part of it, and with one that makes no sense.
    let without = decoded_with_colors(&apart[..scans[2]]);
    assert_eq!((without.colors(), without.damaged_rows()), (None, 0));
    assert_eq!(without, decoded(apart));
    let in_part = decoded_with_colors(&apart[..apart.len() - 60]);
    assert_eq!((in_part.pixels(), in_part.damaged_rows()), (whole.pixels(), 0));
    let [first, last] =
        [|colors: &[u8]| colors[..3].to_vec(), |colors: &[u8]| colors[colors.len() - 3..].to_vec()];
    let [part, all] = [&in_part, &whole].map(|image| image.colors().unwrap());
    assert_eq!(first(part), first(all));
    assert_ne!(last(part), last(all));
    let mut senseless = apart.to_vec();
    senseless[scans[2] + 4] = 9;
    assert_eq!(decoded_with_colors(&senseless), decoded(apart));
}

#[test]
fn missing_rows_have_no_color() {
    let cut = decoded_with_colors(&TOGETHER[..TOGETHER.len() * 2 / 3]);
    assert!(cut.damaged_rows() > 0);
    assert_eq!(cut.colors().unwrap().last_chunk(), Some(&[128; 3]));
}

#[test]
fn colors_take_memory() {
    let (whole, [width, height]) =
        (decoded(TOGETHER), [decoded(TOGETHER).width(), decoded(TOGETHER).height()]);
    let n_pixels = (width * height) as u64;
    let at =
        |max_memory: u64| Image::decode_with_colors(TOGETHER, &Limits { max_memory, ..Limits::default() });
    // More than luma alone takes, and less than luma, two planes of chroma and three bytes a pixel.
    let enough = (1..).map(|n| n * n_pixels).find(|&memory| at(memory).is_ok()).unwrap();
    assert_eq!(at(enough), Ok(whole));
    assert!(at(enough + 8 * n_pixels).unwrap().colors().is_some());
}

fn large() -> Vec<u8> {
    let picture = GrayImage::from_fn(401, 203, |x, y| Luma([(x / 3 + y / 2) as u8]));
    let mut bytes = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut bytes, 95);
    encoder.write_image(&picture, 401, 203, ExtendedColorType::L8).unwrap();
    bytes
}

#[test]
fn frames_beyond_the_limits_are_read_smaller() {
    let whole = decoded(&large());
    assert_eq!(whole.reduction(), 1);
    for (max_pixels, reduction, size) in
        [(81_403, 1, (401, 203)), (81_402, 2, (201, 102)), (20_000, 4, (101, 51)), (5_000, 8, (51, 26))]
    {
        let limits = Limits { max_pixels, enough_side: 50, ..Limits::default() };
        let image = Image::decode(&large(), &limits).unwrap();
        assert_eq!((image.reduction(), (image.width(), image.height())), (reduction, size));
        let expected = whole.shrink_to(size.0).unwrap_or_else(|| whole.clone());
        // Away from the edge, where blocks are filled up.
        for y in 0..expected.height() - 2 {
            let pixels = image.row(y).iter().zip(expected.row(y)).take(size.0 - 2);
            let largest = pixels.map(|(&ours, &theirs)| ours.abs_diff(theirs)).max().unwrap();
            assert!(largest <= 6, "{reduction}, row {y}: {largest}");
        }
    }
    let limits = Limits { max_pixels: 5_000, enough_side: 52, ..Limits::default() };
    assert!(matches!(Image::decode(&large(), &limits), Err(ImageError::TooLarge(_))));
    let narrow = Limits { max_side: 300, enough_side: 50, ..Limits::default() };
    assert_eq!(Image::decode(&large(), &narrow).unwrap().reduction(), 2);
}

proptest! {
    #[test]
    fn damaged_streams_are_read_or_refused(
        bytes in prop::sample::select(ALL.to_vec()),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        length in any::<prop::sample::Index>(),
        max_pixels in prop::sample::select(vec![1u64 << 20, 1000]),
    ) {
        let mut bytes = bytes.to_vec();
        for (position, value) in edits {
            let position = position.index(bytes.len());
            bytes[position] = value;
        }
        bytes.truncate(bytes.len() / 2 + length.index(bytes.len() / 2) + 1);
        let limits = Limits { max_pixels, enough_side: 1, ..Limits::default() };
        let colored = Image::decode_with_colors(&bytes, &limits);
        let uncolored = colored.map(|image| Image { colors: None, ..image });
        prop_assert_eq!(&uncolored, &Image::decode(&bytes, &limits));
        match uncolored {
            Ok(image) => {
                prop_assert_eq!(image.pixels().len(), image.width() * image.height());
                if let Some(visible) = image.visible() {
                    prop_assert!(visible.right <= image.width() && visible.bottom <= image.height());
                    prop_assert!(visible.left < visible.right && visible.top < visible.bottom);
                }
            }
            Err(error) => prop_assert_ne!(error, ImageError::Broken),
        }
    }
}
