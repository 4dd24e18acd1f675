//! `roomsight inspect`: the card of a model, what the core sees in a frame, or the topics of a recording.

use super::data::{self, CameraName, ConfigArgs};
use super::output::{self, say};
use crate::cli::manners::note;
use crate::engine::registry::network_infos;
use anyhow::{Context, bail, ensure};
use clap::Args;
use image::{Rgb, RgbImage};
use roomsight_recognition::model::{Extractor, Features, LoadedModel, Scratch, Seen, Sight, Size};
use roomsight_recording::{Kind, Recording, Topic};
use roomsight_vision::camera::{Camera, CameraKind, Projection};
use roomsight_vision::image::{Image, Limits};
use serde::Serialize;
use std::path::{Path, PathBuf};

const KEYPOINT_COLOR: Rgb<u8> = Rgb([255, 70, 50]);
const REGION_COLOR: Rgb<u8> = Rgb([60, 200, 120]);
const HIDDEN_TINT: Rgb<u8> = Rgb([70, 60, 140]);

/// Show a model's card or the topics of a recording, or draw the keypoints and regions of a frame into a PNG
#[derive(Args)]
pub(super) struct InspectArgs {
    /// Folder of a model, a recording, or an image file
    model_or_frame: PathBuf,
    /// For a frame: look at it as this model does [default: the default configuration]
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["camera", "config", "parameters", "mask"])]
    model: Option<PathBuf>,
    /// For a frame: the camera it comes from; a mirror needs --model
    #[arg(long, value_enum, default_value = "perspective")]
    camera: CameraName,
    /// For a frame: the PNG to write [default: in this folder, the frame's name with
    /// .inspect.png]
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
    #[command(flatten)]
    config: ConfigArgs,
    /// For a model or a recording: print as JSON
    #[arg(long)]
    json: bool,
}

/// Tells a model from a frame by what lies at the path.
pub(super) fn run(args: &InspectArgs) -> anyhow::Result<()> {
    let path = &args.model_or_frame;
    if roomsight_recording::is_called_so(path) {
        ensure!(args.output.is_none(), "a recording is printed: --output is for a frame");
        return print_topics(&Recording::open(path)?, args.json);
    }
    if path.is_dir() || path.extension().is_some_and(|extension| extension == "safetensors") {
        ensure!(args.output.is_none(), "a model is printed: --output is for a frame");
        print_card(&data::load_model(path)?, args.json)
    } else {
        ensure!(!args.json, "a frame is drawn: --json is for a model or a recording");
        draw(args, path)
    }
}

/// What a recording holds.
#[derive(Serialize)]
struct RecordingReport<'a> {
    topics: &'a [Topic],
    /// The first and the last message, in seconds by the clock of the recorder.
    #[serde(skip_serializing_if = "Option::is_none")]
    span_s: Option<[f64; 2]>,
    problems: &'a [String],
}

fn print_topics(recording: &Recording, json: bool) -> anyhow::Result<()> {
    let span_s = recording.span_ns().map(|span| span.map(|time_ns| time_ns as f64 / 1e9));
    let report = RecordingReport { topics: recording.topics(), span_s, problems: recording.problems() };
    if json {
        say!("{}", serde_json::to_string_pretty(&report)?)?;
        return Ok(());
    }
    let mut table = output::table(["topic", "type", "messages", "read as"]);
    for topic in report.topics {
        let read_as = match topic.kind() {
            kind if kind.is_picture() => "pictures",
            kind if kind.is_pose() => "poses",
            Kind::Text => "rooms",
            _ => "-",
        };
        let n_messages = topic.n_messages.map_or("?".to_owned(), |n_messages| n_messages.to_string());
        table.add_row([&topic.name, &topic.type_name, &n_messages, read_as]);
    }
    say!("{table}")?;
    if let Some([first, last]) = span_s {
        say!("From {first:.3} to {last:.3} s: {:.1} s.", last - first)?;
    }
    report.problems.iter().for_each(|problem| note!("note: {problem}"));
    Ok(())
}

fn print_card(LoadedModel { model, digest }: &LoadedModel, json: bool) -> anyhow::Result<()> {
    let card = model.card();
    if json {
        let about = serde_json::json!({
            "digest": digest, "places": model.rooms(), "camera": model.camera().projection,
            "opinions": model.sizes(), "weights": model.weights(), "known_probability": model.known_probability(),
            "networks": model.network_entries(), "card": card, "config": model.config(),
        });
        say!("{}", serde_json::to_string_pretty(&about)?)?;
        return Ok(());
    }
    let mut table = output::table(["model", ""]);
    let mut add = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    add("rooms", model.rooms().join(", "));
    add("camera", camera_text(&model.camera().projection));
    output::card_rows(card).into_iter().for_each(|(name, value)| add(name, value));
    let known_probability = model.known_probability().map(|least| format!("{least:.2}"));
    add("known from probability", known_probability.unwrap_or_else(|| "never".to_owned()));
    for (name, size) in model.sizes() {
        add(&format!("opinion {name}"), format!("counts {:.2}; {}", model.weights()[name], size_text(&size)));
    }
    for network in network_infos(model) {
        add("network", output::network_text(&network));
    }
    add("digest", digest.clone());
    say!("{table}\n\n{}", toml::to_string(model.config())?)?;
    Ok(())
}

fn size_text(Size { n_words, n_support_vectors, n_kept }: &Size) -> String {
    let mut parts: Vec<String> = n_words.map(|n_words| format!("{n_words} words")).into_iter().collect();
    if !n_support_vectors.is_empty() {
        parts.push(format!("support vectors {n_support_vectors:?}"));
    }
    parts.push(format!("keeps {n_kept} to go on from"));
    parts.join(", ")
}

fn camera_text(projection: &Projection) -> String {
    match projection {
        Projection::Perspective => "perspective".to_owned(),
        Projection::Equirectangular => "equirectangular".to_owned(),
        Projection::Omnidirectional(mirror) => format!(
            "omnidirectional; in widths of the frame: center ({:.3}, {:.3}), radii {:.3} to {:.3}",
            mirror.center_x, mirror.center_y, mirror.inner_radius, mirror.outer_radius
        ),
    }
}

fn draw(args: &InspectArgs, path: &Path) -> anyhow::Result<()> {
    let (config, camera) = match &args.model {
        Some(folder) => {
            let model = data::load_model(folder)?.model;
            (model.config().clone(), model.camera().clone())
        }
        None => (args.config.read()?, Camera::new(projection(args.camera.into())?)),
    };
    let extractor = Extractor::new(&config, camera.clone());
    let image = data::read_frame(path, &extractor, &Limits::default())?;
    let features = extractor.extract(&image, &mut Scratch::default());
    let working = image.shrink_to(config.longest_side).unwrap_or(image);
    let picture = picture(&working, &camera, &config.sights(), &features);
    let here = || path.with_extension("inspect.png").file_name().map(PathBuf::from).unwrap_or_default();
    let output = args.output.clone().unwrap_or_else(here);
    picture
        .save_with_format(&output, image::ImageFormat::Png)
        .with_context(|| output.display().to_string())?;
    say!("{} keypoints, drawn into {}", features.n_keypoints(), output.display())?;
    Ok(())
}

fn projection(kind: CameraKind) -> anyhow::Result<Projection> {
    Ok(match kind {
        CameraKind::Perspective => Projection::Perspective,
        CameraKind::Equirectangular => Projection::Equirectangular,
        CameraKind::Omnidirectional => bail!("where the mirror lies is part of a model: give one by --model"),
    })
}

/// The frame with its keypoints, the outlines of their regions, and a tint where nothing is detected.
fn picture(image: &Image, camera: &Camera, sights: &[Sight], features: &Features) -> RgbImage {
    let view = camera.view(image.width(), image.height());
    let mut picture = RgbImage::from_fn(image.width() as u32, image.height() as u32, |x, y| {
        let value = image.row(y as usize)[x as usize];
        if view.contains(x as f32, y as f32, 0.0) {
            Rgb([value; 3])
        } else {
            Rgb(HIDDEN_TINT.0.map(|tint| tint / 2 + value / 4))
        }
    });
    for (sight, seen) in sights.iter().zip(&features.seen) {
        let (Sight::Keypoints { descriptor, .. }, Seen::Local(local)) = (sight, seen) else { continue };
        for keypoint in &local.keypoints {
            let corners = descriptor.square(keypoint, &view);
            for side in 0..4 {
                draw_line(&mut picture, corners[side], corners[(side + 1) % 4], REGION_COLOR);
            }
        }
    }
    for keypoint in features.keypoints() {
        let (x, y) = (keypoint.x, keypoint.y);
        draw_line(&mut picture, (x - 2.0, y), (x + 2.0, y), KEYPOINT_COLOR);
        draw_line(&mut picture, (x, y - 2.0), (x, y + 2.0), KEYPOINT_COLOR);
    }
    picture
}

fn draw_line(picture: &mut RgbImage, from: (f32, f32), to: (f32, f32), color: Rgb<u8>) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let n_steps = dx.abs().max(dy.abs()).ceil().max(1.0) as usize;
    for step in 0..=n_steps {
        let share = step as f32 / n_steps as f32;
        let (x, y) = ((from.0 + share * dx).round(), (from.1 + share * dy).round());
        if x >= 0.0 && y >= 0.0 && x < picture.width() as f32 && y < picture.height() as f32 {
            picture.put_pixel(x as u32, y as u32, color);
        }
    }
}
