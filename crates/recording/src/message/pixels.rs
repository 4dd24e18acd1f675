//! Pixels as cameras and drivers have them, to PGM and PPM: netpbm's formats, which only say how large a picture is.
//!
//! The names of encodings are those of ROS (`sensor_msgs/image_encodings`) and Foxglove.

use crate::error::MessageError;

/// How pixels lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// In pixels.
    pub(super) width: u32,
    pub(super) height: u32,
    /// Bytes from a row to the next.
    pub(super) step: u32,
    /// Of numbers of two bytes.
    pub(super) is_big_endian: bool,
}

/// Pixels without a file's format.
pub(super) struct Pixels<'a> {
    pub(super) encoding: &'a str,
    pub(super) layout: Layout,
    pub(super) bytes: &'a [u8],
}

/// What an encoding says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// A number a channel, of one or two bytes; which of them are red, green and blue, or gray alone.
    Channels { n_bytes: usize, n_channels: usize, order: &'static [usize] },
    /// A color a pixel: that of the first two pixels of the first two rows.
    Bayer { n_bytes: usize, tile: [usize; 4] },
    /// Two pixels in four bytes: where the first luma, the blue difference, the second luma and the red difference are.
    Yuv422 { order: [usize; 4] },
}

const GRAY: &[usize] = &[0];
const RGB: &[usize] = &[0, 1, 2];
const BGR: &[usize] = &[2, 1, 0];
const UYVY: [usize; 4] = [1, 0, 3, 2];
const YUYV: [usize; 4] = [0, 1, 2, 3];

/// Of tiles of Bayer: red, green and blue.
const TILES: [(&str, [usize; 4]); 4] =
    [("rggb", [0, 1, 1, 2]), ("bggr", [2, 1, 1, 0]), ("gbrg", [1, 2, 0, 1]), ("grbg", [1, 0, 2, 1])];

impl Format {
    fn of(encoding: &str) -> Result<Self, MessageError> {
        let channels = |n_bytes, n_channels, order| Ok(Self::Channels { n_bytes, n_channels, order });
        match encoding {
            "mono8" | "8UC1" => channels(1, 1, GRAY),
            "mono16" => channels(2, 1, GRAY),
            "rgb8" => channels(1, 3, RGB),
            "bgr8" | "8UC3" => channels(1, 3, BGR),
            "rgba8" => channels(1, 4, RGB),
            "bgra8" | "8UC4" => channels(1, 4, BGR),
            "rgb16" => channels(2, 3, RGB),
            "bgr16" => channels(2, 3, BGR),
            "rgba16" => channels(2, 4, RGB),
            "bgra16" => channels(2, 4, BGR),
            "yuv422" | "uyvy" => Ok(Self::Yuv422 { order: UYVY }),
            "yuv422_yuy2" | "yuyv" => Ok(Self::Yuv422 { order: YUYV }),
            _ => Self::bayer(encoding).ok_or_else(|| {
                let is_distances = encoding.starts_with("32F") || encoding.starts_with("16U");
                let why = if is_distances {
                    "it is of distances, and shows nothing"
                } else {
                    "mono8, mono16, rgb8, bgr8, rgba8, bgra8, rgb16, bgr16, bayer_*8, bayer_*16, yuv422 and yuv422_yuy2 are"
                };
                MessageError::Pixels(encoding.to_owned(), why)
            }),
        }
    }

    fn bayer(encoding: &str) -> Option<Self> {
        let rest = encoding.strip_prefix("bayer_")?;
        let (_, tile) = TILES.into_iter().find(|(name, _)| rest.starts_with(name))?;
        let n_bytes = match rest.get(4..)? {
            "8" => 1,
            "16" => 2,
            _ => return None,
        };
        Some(Self::Bayer { n_bytes, tile })
    }

    /// The bytes of a row, those between rows left out.
    fn row_bytes(self, width: usize) -> usize {
        match self {
            Self::Channels { n_bytes, n_channels, .. } => width * n_bytes * n_channels,
            Self::Bayer { n_bytes, .. } => width * n_bytes,
            Self::Yuv422 { .. } => width.div_ceil(2) * 4,
        }
    }
}

impl Pixels<'_> {
    /// The same picture as PGM or PPM.
    ///
    /// # Errors
    /// Encodings that are not read, fewer pixels than there should be.
    pub(super) fn to_pnm(&self) -> Result<Vec<u8>, MessageError> {
        let Layout { width, height, is_big_endian, .. } = self.layout;
        let format = Format::of(self.encoding)?;
        let rows = self.rows(format)?;
        let is_gray = matches!(format, Format::Channels { order, .. } if order.len() == 1);
        let n_bytes = match format {
            Format::Channels { n_bytes, .. } | Format::Bayer { n_bytes, .. } => n_bytes,
            Format::Yuv422 { .. } => 1,
        };
        let (kind, largest) = (if is_gray { 5 } else { 6 }, if n_bytes == 1 { 255 } else { 65535 });
        let mut pnm = format!("P{kind}\n{width} {height}\n{largest}\n").into_bytes();
        let numbers = rows.iter().map(|row| numbers(row, n_bytes, is_big_endian)).collect::<Vec<_>>();
        let mut push = |number: u16| match n_bytes {
            1 => pnm.push(number as u8),
            _ => pnm.extend(number.to_be_bytes()),
        };
        match format {
            Format::Channels { n_channels, order, .. } => {
                for pixel in numbers.iter().flat_map(|row| row.chunks_exact(n_channels)) {
                    order.iter().for_each(|&channel| push(pixel[channel]));
                }
            }
            Format::Bayer { tile, .. } => {
                for y in 0..numbers.len() {
                    for x in 0..width as usize {
                        colors(&numbers, tile, x, y).into_iter().for_each(&mut push);
                    }
                }
            }
            Format::Yuv422 { order } => {
                for row in &numbers {
                    let pairs = row.chunks_exact(4).flat_map(|pair| {
                        let [first, blue, second, red] = order.map(|idx| pair[idx]);
                        [rgb(first, blue, red), rgb(second, blue, red)]
                    });
                    pairs.take(width as usize).flatten().for_each(&mut push);
                }
            }
        }
        Ok(pnm)
    }

    /// The bytes of each row.
    fn rows(&self, format: Format) -> Result<Vec<&[u8]>, MessageError> {
        let Layout { width, height, step, .. } = self.layout;
        let too_few = MessageError::TooFewPixels { width, height, step, n_bytes: self.bytes.len() };
        let row_bytes = format.row_bytes(width as usize);
        // A driver may leave it unsaid.
        let step = if step == 0 { row_bytes } else { step as usize };
        if width == 0 || height == 0 || step < row_bytes {
            return Err(too_few);
        }
        let row = |y: usize| self.bytes.get(y.checked_mul(step)?..)?.get(..row_bytes);
        let rows: Option<Vec<&[u8]>> =
            if row(height as usize - 1).is_some() { (0..height as usize).map(row).collect() } else { None };
        rows.ok_or(too_few)
    }
}

/// The numbers of a row.
fn numbers(row: &[u8], n_bytes: usize, is_big_endian: bool) -> Vec<u16> {
    if n_bytes == 1 {
        return row.iter().map(|&byte| u16::from(byte)).collect();
    }
    let pair =
        |pair: &[u8; 2]| if is_big_endian { u16::from_be_bytes(*pair) } else { u16::from_le_bytes(*pair) };
    row.as_chunks().0.iter().map(pair).collect()
}

/// Red, green and blue of a pixel of which the sensor saw one: the means of those beside it.
fn colors(rows: &[Vec<u16>], tile: [usize; 4], x: usize, y: usize) -> [u16; 3] {
    let own = tile[y % 2 * 2 + x % 2];
    let (mut sums, mut counts) = ([0_u32; 3], [0_u32; 3]);
    for y in y.saturating_sub(1)..(y + 2).min(rows.len()) {
        for x in x.saturating_sub(1)..(x + 2).min(rows[y].len()) {
            let color = tile[y % 2 * 2 + x % 2];
            sums[color] += u32::from(rows[y][x]);
            counts[color] += 1;
        }
    }
    let mut colors = [0, 1, 2].map(|color| ((sums[color] + counts[color] / 2) / counts[color].max(1)) as u16);
    colors[own] = rows[y][x];
    colors
}

/// Red, green and blue of video (ITU-R BT.601, in its range from 16 to 235).
fn rgb(luma: u16, blue: u16, red: u16) -> [u16; 3] {
    let [luma, blue, red] =
        [(luma, 16.0), (blue, 128.0), (red, 128.0)].map(|(value, zero)| f32::from(value) - zero);
    let luma = 1.164 * luma;
    [luma + 1.596 * red, luma - 0.813 * red - 0.391 * blue, luma + 2.018 * blue]
        .map(|value| value.round().clamp(0.0, 255.0) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pnm(encoding: &str, [width, height, step]: [u32; 3], bytes: &[u8]) -> Result<Vec<u8>, MessageError> {
        let layout = Layout { width, height, step, is_big_endian: false };
        Pixels { encoding, layout, bytes }.to_pnm()
    }

    #[test]
    fn channels_come_in_the_order_of_the_format() {
        assert_eq!(pnm("mono8", [2, 1, 2], &[7, 9]).unwrap(), b"P5\n2 1\n255\n\x07\x09");
        assert_eq!(pnm("bgr8", [1, 1, 3], &[1, 2, 3]).unwrap(), b"P6\n1 1\n255\n\x03\x02\x01");
        assert_eq!(pnm("rgba8", [1, 1, 4], &[1, 2, 3, 4]).unwrap(), b"P6\n1 1\n255\n\x01\x02\x03");
        assert_eq!(pnm("mono16", [1, 1, 2], &[1, 2]).unwrap(), b"P5\n1 1\n65535\n\x02\x01");
    }

    #[test]
    fn rows_may_be_longer_than_their_pixels() {
        let rows = [1, 2, 99, 3, 4];
        assert_eq!(pnm("mono8", [2, 2, 3], &rows).unwrap(), b"P5\n2 2\n255\n\x01\x02\x03\x04");
        assert_eq!(pnm("mono8", [2, 2, 0], &rows).unwrap(), b"P5\n2 2\n255\n\x01\x02\x63\x03");
        assert!(matches!(pnm("mono8", [2, 3, 3], &rows), Err(MessageError::TooFewPixels { .. })));
        assert!(matches!(pnm("mono8", [3, 2, 2], &rows), Err(MessageError::TooFewPixels { .. })));
    }

    #[test]
    fn sensors_of_one_color_a_pixel_show_even_colors_as_they_are() {
        for (name, tile) in TILES {
            // Red 10, green 20, blue 30.
            let bytes: Vec<u8> =
                (0..6 * 4).map(|idx| 10 * (1 + tile[idx / 6 % 2 * 2 + idx % 2]) as u8).collect();
            let pnm = pnm(&format!("bayer_{name}8"), [6, 4, 6], &bytes).unwrap();
            let pixels = &pnm[b"P6\n6 4\n255\n".len()..];
            assert!(pixels.chunks(3).all(|pixel| pixel == [10, 20, 30]), "{name}: {pixels:?}");
        }
    }

    #[test]
    fn video_has_its_white_black_and_red() {
        let pixels = |encoding: &str, bytes: &[u8]| pnm(encoding, [2, 1, 4], bytes).unwrap()[11..].to_vec();
        assert_eq!(pixels("yuv422", &[128, 235, 128, 16]), [255, 255, 255, 0, 0, 0]);
        assert_eq!(pixels("yuv422_yuy2", &[81, 90, 81, 240]), [254, 0, 0, 254, 0, 0]);
    }

    #[test]
    fn what_is_no_picture_is_named() {
        let why = |encoding: &str| pnm(encoding, [1, 1, 4], &[0; 4]).unwrap_err().to_string();
        assert!(why("16UC1").contains("distances") && why("32FC1").contains("distances"));
        assert!(why("bayer_rggb12").contains("bayer_*16,"), "{}", why("bayer_rggb12"));
    }

    proptest! {
        #[test]
        fn no_size_panics(
            encoding in prop::sample::select(vec!["mono8", "mono16", "rgb8", "bayer_grbg16", "yuv422"]),
            size in [0_u32..40, 0_u32..40, 0_u32..90],
            bytes in prop::collection::vec(any::<u8>(), 0..400),
        ) {
            let _ = pnm(encoding, size, &bytes);
            let _ = pnm(encoding, [u32::MAX, u32::MAX, size[2]], &bytes);
        }
    }
}
