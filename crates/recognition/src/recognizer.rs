//! A model and its working memory: what a program needs to recognize rooms.

use crate::model::{LoadError, Model, Recognition, Scratch};
use roomsight_vision::image::{Image, ImageError, Limits};
use std::path::Path;

/// Recognizes frames, one after the other. Threads have one each.
#[derive(Debug)]
pub struct Recognizer {
    model: Model,
    scratch: Scratch,
}

impl Recognizer {
    /// The model in a folder, as `roomsight train` writes it.
    ///
    /// # Errors
    /// What is missing or damaged.
    pub fn open(folder: &Path) -> Result<Self, LoadError> {
        Ok(Self::new(Model::load(folder)?.model))
    }

    /// This model.
    pub fn new(model: Model) -> Self {
        Self { model, scratch: Scratch::default() }
    }

    /// What an encoded frame shows: JPEG, PNG, WebP, BMP or PNM of up to 16 MiB and 50 megapixels ([`Limits::default`]).
    ///
    /// # Errors
    /// The bytes are no image, or one beyond the limits.
    pub fn recognize(&mut self, encoded: &[u8]) -> Result<Recognition, ImageError> {
        let image = self.model.decode(encoded, &Limits::default())?;
        Ok(self.recognize_image(&image))
    }

    /// What a frame shows. A model that looks at colors needs [`Image::decode_with_colors`].
    pub fn recognize_image(&mut self, image: &Image) -> Recognition {
        self.model.recognize(image, &mut self.scratch)
    }

    /// The most probable room of an answer of this model.
    pub fn room(&self, recognition: &Recognition) -> &str {
        &self.model.rooms()[recognition.room_idx]
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }
}
