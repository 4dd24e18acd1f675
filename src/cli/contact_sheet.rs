//! Contact sheets: small pictures with what is said of them, as an HTML page in one file.

use crate::cli::manners::note;
use crate::engine::thumbnails::thumbnail;
use anyhow::Context;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use bytes::Bytes;
use rayon::prelude::*;
use roomsight_lab::dataset::Dataset;
use roomsight_lab::page::{escape, page};
use roomsight_vision::image::Limits;
use std::fs;
use std::path::{Path, PathBuf};

/// The width of a small picture, in pixels.
const WIDTH: u32 = 220;

/// The most pictures of a section that are shown.
const MAX_CARDS: usize = 200;

/// Pictures with something in common.
pub(super) struct Section {
    /// What that is.
    pub heading: String,
    /// In order.
    pub cards: Vec<Card>,
}

/// A picture, and what is said of it.
pub(super) struct Card {
    pub picture: PathBuf,
    /// Lines below it.
    pub lines: Vec<String>,
    /// Other pictures, such as the one that it is a copy of, each with a line.
    pub beside: Vec<(PathBuf, String)>,
}

/// Writes a sheet to a new file or over an old one. A picture that cannot be read is an empty place.
pub(super) fn write(
    path: &Path,
    title: &str,
    sections: &[Section],
    dataset: &Dataset,
    limits: &Limits,
) -> anyhow::Result<()> {
    let small = |picture: &Path| thumbnail(&dataset.read_picture(picture, limits).ok()?, WIDTH, *limits).ok();
    fs::write(path, html(title, sections, &small)).with_context(|| path.display().to_string())?;
    note!("written: {}", path.display());
    Ok(())
}

/// What gives a small picture; none of one that cannot be read.
type Small<'a> = &'a (dyn Fn(&Path) -> Option<Bytes> + Sync);

fn html(title: &str, sections: &[Section], small: Small) -> String {
    let mut body = format!("<h1>{}</h1>\n{STYLE}", escape(title));
    for Section { heading, cards } in sections.iter().filter(|section| !section.cards.is_empty()) {
        let shown = &cards[..cards.len().min(MAX_CARDS)];
        let figures: Vec<String> = shown.par_iter().map(|card| figure(card, small)).collect();
        body += &format!("<section><h2>{} ({})</h2>\n<div class=\"sheet\">\n", escape(heading), cards.len());
        body += &figures.concat();
        body += "</div>\n";
        if shown.len() < cards.len() {
            body += &format!("<p>{} more are not shown.</p>\n", cards.len() - shown.len());
        }
        body += "</section>\n";
    }
    page(title, &body)
}

fn figure(Card { picture, lines, beside }: &Card, small: Small) -> String {
    let mut html = format!("<figure>{}<figcaption>", shown(picture, small));
    for line in lines {
        html += &format!("<div>{}</div>", escape(line));
    }
    html += "</figcaption>";
    for (other, line) in beside {
        html += &format!("<div class=\"beside\">{}<div>{}</div></div>", shown(other, small), escape(line));
    }
    html + "</figure>\n"
}

/// The picture as a part of the page, named by its path.
fn shown(picture: &Path, small: Small) -> String {
    let name = escape(&picture.display().to_string());
    match small(picture) {
        Some(bytes) => {
            let data = BASE64_STANDARD.encode(bytes);
            format!("<img alt=\"{name}\" title=\"{name}\" src=\"data:image/jpeg;base64,{data}\">")
        }
        None => format!("<i title=\"{name}\">not to be seen: {name}</i>"),
    }
}

const STYLE: &str = "<style>
body { max-width: 100rem; }
.sheet { display: flex; flex-wrap: wrap; gap: 1rem; align-items: flex-start; }
figure { margin: 0; padding: .5rem; border: 1px solid var(--line); border-radius: .4rem; max-width: 460px; }
figure > img { display: block; max-width: 100%; } figcaption { font-size: 13px; max-width: 220px; overflow-wrap: anywhere; }
.beside { display: inline-block; vertical-align: top; font-size: 12px; color: var(--soft); margin: .5rem .5rem 0 0; max-width: 120px;
  overflow-wrap: anywhere; }
.beside img { max-width: 120px; display: block; }
</style>
";

#[cfg(test)]
mod tests {
    use super::*;
    use image::GrayImage;

    #[test]
    fn pictures_are_in_the_page_and_names_cannot_become_markup() {
        let folder = tempfile::tempdir().unwrap();
        let picture = folder.path().join("<b>.png");
        GrayImage::from_fn(640, 480, |x, y| image::Luma([(x + y) as u8])).save(&picture).unwrap();
        let missing = folder.path().join("gone.png");
        let card = Card {
            picture,
            lines: vec!["shows <hall>".to_owned()],
            beside: vec![(missing, "a & b".to_owned())],
        };
        let section = Section { heading: "Wrong".to_owned(), cards: vec![card] };
        let empty = Section { heading: "Empty".to_owned(), cards: Vec::new() };
        let small = |picture: &Path| thumbnail(&fs::read(picture).ok()?, WIDTH, Limits::default()).ok();
        let html = html("Sheet", &[section, empty], &small);
        assert!(html.contains("shows &lt;hall&gt;") && html.contains("a &amp; b") && !html.contains("<b>"));
        assert!(html.contains("src=\"data:image/jpeg;base64,") && html.contains("not to be seen: "));
        assert!(html.contains("Wrong (1)") && !html.contains("Empty") && html.len() < 20_000);
    }
}
