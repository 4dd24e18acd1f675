//! Pictures of every kind give the luma and the colors that Pillow reads in them.
//!
//! `tests/pictures/matrix.py` makes the pictures, `make test-python` runs both.

use roomsight_vision::image::{Image, Limits};
use std::path::PathBuf;
use std::{env, fs};

/// How far the luma of a pixel may be from Pillow's.
const TOLERANCE: u8 = 2;

/// How far red, green or blue may be.
const COLOR_TOLERANCE: u8 = 1;

/// A matrix of fewer pictures was not written whole.
const MIN_PICTURES: usize = 2000;

#[test]
fn pictures_give_the_luma_and_the_colors_that_pillow_reads() {
    let Some(folder) = env::var_os("ROOMSIGHT_PICTURES").map(PathBuf::from) else {
        eprintln!(
            "LEFT OUT: the pictures to compare are made by tests/pictures/matrix.py, see `make test-python`"
        );
        return;
    };
    let mut wrong = Vec::new();
    let mut n_pictures = 0;
    for entry in fs::read_dir(&folder).expect("ROOMSIGHT_PICTURES names a folder") {
        let path = entry.unwrap().path();
        let Some(of_picture) = path.to_str().unwrap().strip_suffix(".luma") else { continue };
        n_pictures += 1;
        if let Err(reason) = compare(&fs::read(of_picture).unwrap(), &fs::read(&path).unwrap()) {
            wrong.push(format!("{of_picture}: {reason}"));
        }
    }
    assert!(n_pictures >= MIN_PICTURES, "only {n_pictures} pictures are in {}", folder.display());
    assert!(wrong.is_empty(), "{} of {n_pictures}:\n{}", wrong.len(), wrong.join("\n"));
}

/// Width and height as 32-bit numbers, the luma, and then the colors, if any: what `matrix.py` writes.
fn compare(picture: &[u8], expected: &[u8]) -> Result<(), String> {
    let (sides, pixels) = expected.split_at(8);
    let &[width, height] = sides.as_chunks::<4>().0 else { return Err("its luma is too short".into()) };
    let [width, height] = [width, height].map(|side| u32::from_le_bytes(side) as usize);
    let image = Image::decode_with_colors(picture, &Limits::default()).map_err(|error| error.to_string())?;
    if (image.width(), image.height()) != (width, height) {
        return Err(format!("{} x {} instead of {width} x {height}", image.width(), image.height()));
    }
    if image.damaged_rows() > 0 {
        return Err(format!("{} rows are taken to be damaged", image.damaged_rows()));
    }
    let (luma, colors) = pixels.split_at(width * height);
    let largest = furthest(image.pixels(), luma);
    if largest > TOLERANCE {
        return Err(format!("a pixel is {largest} off"));
    }
    // Pillow knows gray from colored where this crate does not, and the other way round.
    let gray = |luma: &[u8]| luma.iter().flat_map(|&luma| [luma; 3]).collect::<Vec<u8>>();
    let ours = image.colors().map_or_else(|| gray(image.pixels()), <[u8]>::to_vec);
    let theirs = if colors.is_empty() { gray(luma) } else { colors.to_vec() };
    if ours.len() != theirs.len() {
        return Err(format!("{} colors instead of {}", ours.len(), theirs.len()));
    }
    let largest = furthest(&ours, &theirs);
    if largest > COLOR_TOLERANCE {
        return Err(format!("a color is {largest} off"));
    }
    Ok(())
}

/// The largest difference.
fn furthest(ours: &[u8], theirs: &[u8]) -> u8 {
    ours.iter().zip(theirs).map(|(&ours, &theirs)| ours.abs_diff(theirs)).max().unwrap_or(0)
}
