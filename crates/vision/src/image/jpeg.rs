//! JPEG straight to luma: planes that do not count are neither transformed nor kept. They count where colors are
//! asked for; the luma is the same.
//!
//! It reads what cameras send: sequential and progressive frames of 8 bits, in one scan or a scan a
//! component, in any sampling, with and without Huffman tables of their own. The numbers are those of
//! libjpeg-turbo. What is missing stays gray, and which rows that are is told; a decoder that fills them with
//! what it makes of damaged data would show corners that the camera never saw.

mod bits;
mod blocks;
mod frame;
mod huffman;
mod reduced;
mod samples;
mod scan;
#[cfg(test)]
mod tests;

use super::{Gap, ImageError, Limits, Region, check_size, damaged, exif, unsupported};
use blocks::{Part, Pass, ZIGZAG};
use frame::{Component, Frame, RowState};
use huffman::{Class, Table};
use image::metadata::Orientation;
use samples::Pixels;
use scan::Scan;
use std::sync::Arc;
use std::{array, mem};

/// A progressive frame brings its whole area once a scan; real ones have about ten.
const MAX_SCANS: usize = 64;

/// A frame is refused where less than one part in so many of its rows lies together.
const MIN_VISIBLE_SHARE: usize = 3;

/// What XMP begins with.
const XMP: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";

/// What a JPEG shows, not turned.
pub(super) struct Picture {
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// The luma, row after row.
    pub luma: Vec<u8>,
    /// Red, green and blue of each pixel, if asked for and there.
    pub colors: Option<Vec<u8>>,
    /// Pixels of the frame for one that was read, along a side: 1, 2, 4 or 8.
    pub reduction: usize,
    /// What is missing.
    pub gap: Option<Gap>,
    /// How to turn it.
    pub orientation: Option<Orientation>,
}

/// How components make colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Colors {
    Gray,
    YCbCr,
    Rgb,
    Cmyk,
    Ycck,
}

/// What the markers said so far.
struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
    with_colors: bool,
    quantization: [Option<[u16; 64]>; 4],
    dc: [Option<Arc<Table>>; 4],
    ac: [Option<Arc<Table>>; 4],
    restart_interval: usize,
    is_jfif: bool,
    /// The transform of colors that Adobe's programs note.
    adobe: Option<u8>,
    in_exif: Option<Orientation>,
    in_xmp: Option<Orientation>,
    frame: Option<Frame>,
    /// What the components of the frame make, from its first scan on.
    colors: Colors,
    side: usize,
    n_scans: usize,
    /// Whether the marker of the end came.
    has_ended: bool,
}

/// Reads a JPEG. One that is beyond the limits on pixels or memory is read at a half, a quarter or an eighth
/// of its size, as long as its longest side stays above [`Limits::enough_side`].
///
/// Whether colors are wanted changes nothing else: what is wrong with them alone costs them alone.
pub(super) fn decode(bytes: &[u8], limits: &Limits, with_colors: bool) -> Result<Picture, ImageError> {
    let mut reader = Reader {
        bytes,
        position: 0,
        with_colors,
        quantization: [None; 4],
        dc: array::from_fn(|_| None),
        ac: array::from_fn(|_| None),
        restart_interval: 0,
        is_jfif: false,
        adobe: None,
        in_exif: None,
        in_xmp: None,
        frame: None,
        colors: Colors::Gray,
        side: 8,
        n_scans: 0,
        has_ended: false,
    };
    while !reader.is_complete(|component| component.is_wanted) {
        let has_luma = reader.is_complete(Component::is_needed);
        match reader.read_marker(limits) {
            Ok(true) => {}
            Ok(false) => break,
            Err(_) if has_luma => break,
            Err(error) => return Err(error),
        }
    }
    reader.finish()
}

impl<'a> Reader<'a> {
    /// Whether all that counts of a sequential frame was read: what follows is of no interest.
    fn is_complete(&self, counts: impl Fn(&Component) -> bool) -> bool {
        let is_read = |component: &Component| component.was_sent || !counts(component);
        self.frame.as_ref().is_some_and(|frame| !frame.is_progressive && frame.components.iter().all(is_read))
    }

    /// Reads up to the end of the next marker; false where there is none, or the picture's end.
    fn read_marker(&mut self, limits: &Limits) -> Result<bool, ImageError> {
        let Some(at) = bits::next_marker(self.bytes, self.position) else { return Ok(false) };
        let marker = self.bytes[at + 1];
        self.position = at + 2;
        match marker {
            0xD9 => {
                self.has_ended = true;
                return Ok(false);
            }
            // The start, restarts out of place, and one that means nothing.
            0xD8 | 0xD0..=0xD7 | 0x01 => return Ok(true),
            _ => {}
        }
        let Some(segment) = self.segment() else {
            return match &self.frame {
                // It ends here; what was read may do.
                Some(frame) if frame.components.iter().any(|component| component.was_sent) => Ok(false),
                _ => Err(damaged("it ends within its header")),
            };
        };
        match marker {
            0xC0..=0xC2 if self.frame.is_some() => return Err(damaged("it has two frame headers")),
            0xC0..=0xC2 => self.frame = Some(Frame::read(segment, marker == 0xC2)?),
            0xC4 => self.define_huffman(segment)?,
            0xDB => self.define_quantization(segment)?,
            0xDD => {
                self.restart_interval =
                    segment.first_chunk().map_or(0, |&n| usize::from(u16::from_be_bytes(n)));
            }
            0xDA => self.scan(segment, limits)?,
            0xE0 => self.is_jfif |= segment.starts_with(b"JFIF\0"),
            // Nothing but colors is read behind the luma.
            0xE1 if !self.is_complete(Component::is_needed) => {
                self.in_exif = self.in_exif.or_else(|| exif::in_exif(segment));
                self.in_xmp = self.in_xmp.or_else(|| exif::in_xmp(segment.strip_prefix(XMP)?));
            }
            0xEE if segment.starts_with(b"Adobe") => self.adobe = segment.get(11).copied(),
            0xF7 => {
                return Err(unsupported("a JPEG-LS", "save it as baseline or progressive JPEG, or as PNG"));
            }
            0xC3 => {
                return Err(unsupported(
                    "a lossless JPEG",
                    "save it as baseline or progressive JPEG, or as PNG",
                ));
            }
            0xC9 | 0xCA => {
                return Err(unsupported("an arithmetic-coded JPEG", "save it with Huffman coding, as usual"));
            }
            0xC5..=0xC7 | 0xCB | 0xCD..=0xCF => {
                return Err(unsupported(
                    "a hierarchical or lossless JPEG",
                    "save it as baseline or progressive JPEG",
                ));
            }
            _ => {}
        }
        Ok(true)
    }

    /// The content of a marker, stepped over; `None` where it does not end.
    fn segment(&mut self) -> Option<&'a [u8]> {
        let (length, _) = self.bytes.get(self.position..)?.split_first_chunk()?;
        let length = usize::from(u16::from_be_bytes(*length));
        let segment = self.bytes.get(self.position + 2..self.position + length)?;
        self.position += length;
        Some(segment)
    }

    fn define_quantization(&mut self, mut segment: &[u8]) -> Result<(), ImageError> {
        while let Some((&head, rest)) = segment.split_first() {
            let n_bytes = if head >> 4 == 0 { 64 } else { 128 };
            let (Some(values), Some(table)) =
                (rest.get(..n_bytes), self.quantization.get_mut(usize::from(head & 15)))
            else {
                return Err(damaged("a quantization table is wrong"));
            };
            let table = table.insert([0; 64]);
            for (k, &position) in ZIGZAG.iter().enumerate() {
                let value = match n_bytes {
                    64 => u16::from(values[k]),
                    _ => u16::from_be_bytes([values[2 * k], values[2 * k + 1]]),
                };
                table[usize::from(position)] = value;
            }
            segment = &rest[n_bytes..];
        }
        Ok(())
    }

    fn define_huffman(&mut self, mut segment: &[u8]) -> Result<(), ImageError> {
        let wrong = || damaged("a Huffman table is wrong");
        while let Some((&head, rest)) = segment.split_first() {
            let (counts, rest) = rest.split_first_chunk().ok_or_else(wrong)?;
            let n_symbols: usize = counts.iter().map(|&count| usize::from(count)).sum();
            let symbols = rest.get(..n_symbols).filter(|symbols| symbols.len() <= 256).ok_or_else(wrong)?;
            let tables = match head >> 4 {
                0 => &mut self.dc,
                1 => &mut self.ac,
                _ => return Err(wrong()),
            };
            let table = tables.get_mut(usize::from(head & 15)).ok_or_else(wrong)?;
            *table = Some(Table::shared(counts, symbols).ok_or_else(wrong)?);
            segment = &rest[n_symbols..];
        }
        Ok(())
    }

    /// Decides, with all that comes before the first scan, which planes are wanted and at which size, and makes
    /// room for them.
    fn begin_pixels(&mut self, frame: &mut Frame, limits: &Limits) -> Result<(), ImageError> {
        self.colors = self.guessed_colors(frame);
        if self.colors == Colors::YCbCr {
            for component in &mut frame.components[1..] {
                (component.is_wanted, component.only_colors) = (self.with_colors, true);
            }
        }
        // A copy of a scan, without the zeros that are stuffed into it.
        let n_bytes = self.bytes.len() as u64;
        let check = |side: usize| {
            let [width, height] = frame.size_at(side);
            check_size(width as u64, height as u64, n_bytes + frame.memory_at(side), limits)
        };
        let fits = |side: usize| {
            let longest = frame.size_at(side).into_iter().max().unwrap_or(0);
            check(side).is_ok() && longest >= limits.enough_side as usize
        };
        self.side =
            if check(8).is_ok() { 8 } else { [4, 2, 1].into_iter().find(|&side| fits(side)).unwrap_or(8) };
        check(self.side)?;
        let memory = n_bytes + frame.memory_at(self.side) + frame.memory_of_colors_at(self.side);
        if memory > limits.max_memory {
            self.with_colors = false;
            frame.give_up_colors();
        }
        frame.allocate(self.side);
        Ok(())
    }

    /// As libjpeg guesses them.
    fn guessed_colors(&self, frame: &Frame) -> Colors {
        let ids: Vec<u8> = frame.components.iter().map(|component| component.id).collect();
        match (&ids[..], self.adobe) {
            ([_], _) => Colors::Gray,
            ([_, _, _, _], None | Some(0)) => Colors::Cmyk,
            ([_, _, _, _], Some(_)) => Colors::Ycck,
            _ if self.is_jfif => Colors::YCbCr,
            (_, Some(0)) => Colors::Rgb,
            (_, Some(_)) => Colors::YCbCr,
            (b"RGB", None) => Colors::Rgb,
            _ => Colors::YCbCr,
        }
    }

    fn scan(&mut self, header: &[u8], limits: &Limits) -> Result<(), ImageError> {
        let mut frame = self.frame.take().ok_or_else(|| damaged("a scan comes before the frame header"))?;
        if self.n_scans == 0 {
            self.begin_pixels(&mut frame, limits)?;
        }
        let result = self.read_scan(header, &mut frame);
        self.frame = Some(frame);
        result
    }

    fn read_scan(&mut self, header: &[u8], frame: &mut Frame) -> Result<(), ImageError> {
        self.n_scans += 1;
        if self.n_scans > MAX_SCANS {
            return Err(damaged(&format!("it has more than {MAX_SCANS} scans")));
        }
        let wrong = || damaged("a scan header is wrong");
        let (&n_parts, rest) = header.split_first().ok_or_else(wrong)?;
        let n_parts = usize::from(n_parts);
        let (entries, tail) = rest.split_at_checked(2 * n_parts).ok_or_else(wrong)?;
        let &[start, end, bits, ..] = tail else { return Err(wrong()) };
        let mut pass = Pass { band: 0..64, high: 0, low: 0 };
        if frame.is_progressive {
            pass = Pass { band: usize::from(start)..usize::from(end) + 1, high: bits >> 4, low: bits & 15 };
            let is_alone = pass.band.start == 0 && pass.band.end == 1 || pass.band.start > 0 && n_parts == 1;
            if !is_alone || pass.band.is_empty() || pass.band.end > 64 || pass.low > 13 {
                return Err(wrong());
            }
        }
        let mut chosen = Vec::with_capacity(n_parts);
        for &[id, tables] in entries.as_chunks::<2>().0 {
            // Some encoders give all one id: the first that is not taken is meant, as libjpeg-turbo reads it.
            let is_free = |idx: usize| chosen.iter().all(|&(taken, _)| taken != idx);
            let is_meant = |&idx: &usize| frame.components[idx].id == id && is_free(idx);
            let component_idx = (0..frame.components.len()).find(is_meant).ok_or_else(wrong)?;
            chosen.push((component_idx, tables));
        }
        if chosen.is_empty() {
            return Err(wrong());
        }
        for &(component_idx, _) in &chosen {
            let component = &mut frame.components[component_idx];
            note_pass(component, &pass, frame.is_progressive)?;
            if component.quantization.is_none() {
                let table = self.quantization.get(component.table_number).copied().flatten();
                component.quantization = table;
                if component.is_needed() && table.is_none() {
                    return Err(damaged("a quantization table is missing"));
                }
            }
        }
        let lacks_table = |component: &Component| component.quantization.is_none();
        if chosen.iter().any(|&(component_idx, _)| lacks_table(&frame.components[component_idx])) {
            // None that the luma takes.
            frame.give_up_colors();
        }
        if chosen.iter().all(|&(component_idx, _)| !frame.components[component_idx].is_wanted) {
            // Up to the next marker that is no restart.
            return Ok(());
        }
        let (has_first, has_others) = (pass.band.start == 0, pass.band.end > 1);
        let (needs_dc, needs_ac) = (has_first && pass.is_first(), has_others);
        for &(_, tables) in &chosen {
            let filled = fill_in(&mut self.dc, needs_dc, Class::Dc, tables >> 4)
                .and_then(|()| fill_in(&mut self.ac, needs_ac, Class::Ac, tables & 15));
            if filled.is_err() && !chosen.iter().any(|&(idx, _)| frame.components[idx].is_needed()) {
                frame.give_up_colors();
                return Ok(());
            }
            filled?;
        }
        let parts = chosen.iter().map(|&(component_idx, tables)| Part {
            component_idx,
            dc: self.dc.get(usize::from(tables >> 4)).and_then(Option::as_ref),
            ac: self.ac.get(usize::from(tables & 15)).and_then(Option::as_ref),
        });
        let scan = Scan { parts: parts.collect(), pass, restart_interval: self.restart_interval };
        self.position = scan::read(frame, &scan, self.bytes, self.position);
        Ok(())
    }

    fn finish(mut self) -> Result<Picture, ImageError> {
        let Some(mut frame) = self.frame.take() else { return Err(damaged("it has no frame header")) };
        if frame.components.iter().any(|component| component.is_needed() && !component.was_sent) {
            return Err(damaged("it ends before its pixels begin"));
        }
        if frame.components.iter().any(|component| component.is_wanted && !component.was_sent) {
            frame.give_up_colors();
        }
        if frame.is_progressive && !self.has_ended {
            // Nobody knows how many scans were to come.
            frame.note(0..frame.height, RowState::Coarse);
        }
        let whole_rows = frame.whole_rows();
        if whole_rows.len() * MIN_VISIBLE_SHARE < frame.height {
            return Err(damaged(&format!(
                "of its {} rows only {} are there; send the whole file",
                frame.height,
                frame.rows.iter().filter(|&&row| row != RowState::Missing).count(),
            )));
        }
        if frame.is_progressive {
            for component in frame.components.iter_mut().filter(|component| component.is_wanted) {
                let blocks = mem::take(&mut component.blocks);
                component.transform(&blocks, 0);
            }
        }
        let n_damaged = frame.rows.iter().filter(|&&row| row != RowState::Whole).count();
        let reduction = 8 / self.side;
        let [width, height] = frame.size_at(self.side);
        let visible = Region {
            left: 0,
            top: whole_rows.start.div_ceil(reduction),
            right: width,
            bottom: if whole_rows.end == frame.height { height } else { whole_rows.end / reduction },
        };
        let gap = (n_damaged > 0).then_some(Gap { damaged_rows: n_damaged, visible });
        let orientation = self.in_exif.or(self.in_xmp);
        let Pixels { luma, colors } = samples::pixels(&mut frame, self.colors, self.side, self.with_colors)?;
        Ok(Picture { width, height, luma, colors, reduction, gap, orientation })
    }
}

/// Takes note of what a scan brings for a component. Nothing may come twice, which bounds the work that a
/// stream can ask for.
fn note_pass(component: &mut Component, pass: &Pass, is_progressive: bool) -> Result<(), ImageError> {
    if is_progressive {
        for missing_bits in &mut component.missing_bits[pass.band.clone()] {
            let is_next = match *missing_bits {
                None => pass.is_first(),
                Some(missing) => !pass.is_first() && missing == pass.high && pass.low + 1 == pass.high,
            };
            if !is_next {
                return Err(damaged("its scans do not follow each other"));
            }
            *missing_bits = Some(pass.low);
        }
    } else if component.was_sent {
        return Err(damaged("a component comes in two scans"));
    }
    component.was_sent |= pass.band.start == 0;
    Ok(())
}

/// Puts the standard's table in the place of one that is needed and did not come.
fn fill_in(
    tables: &mut [Option<Arc<Table>>; 4],
    is_needed: bool,
    class: Class,
    number: u8,
) -> Result<(), ImageError> {
    if !is_needed {
        return Ok(());
    }
    let missing = || damaged("a Huffman table is missing");
    let table = tables.get_mut(usize::from(number)).ok_or_else(missing)?;
    if table.is_none() {
        *table = Some(Table::standard(class, usize::from(number)).ok_or_else(missing)?);
    }
    Ok(())
}
