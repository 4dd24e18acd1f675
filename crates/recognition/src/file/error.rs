//! Why bytes are no model.

use roomsight_vision::network::NetworkError;

/// The last version of the file's layout.
pub const FORMAT_VERSION: u32 = 3;

/// The version of models that always ask all opinions.
pub(crate) const VERSION_OF_ALL: u32 = 2;

/// Why bytes are no model; the text says what is wrong.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// Not a safetensors file, or damaged.
    #[error("not a roomsight model, or damaged: {0}")]
    NotAModel(String),
    /// A model of another layout.
    #[error(
        "the model has format version {found}; this program reads versions up to {FORMAT_VERSION}: \
         train it again or use another version of roomsight"
    )]
    OtherVersion {
        /// The version it has.
        found: u32,
    },
    /// A model whose parts do not fit.
    #[error("the model is damaged: {0}")]
    Damaged(String),
    /// A model that is given other networks than it was trained with, or none.
    #[error(
        "the model file and model.json name different networks: send the model's whole folder as `train` writes it"
    )]
    OtherNetworks,
    /// A network that it looks through cannot be used here.
    #[error(transparent)]
    Network(#[from] NetworkError),
}
