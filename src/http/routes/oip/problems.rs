//! What can go wrong, for the OpenAPI document.

use crate::http::openapi::{AUTH_KINDS, frame_kinds, responses};
use crate::http::problem::ErrorForm;
use crate::problem::Kind;
use std::collections::BTreeMap;
use utoipa::IntoResponses;
use utoipa::openapi::{RefOr, Response};

/// What can go wrong with frames.
pub struct InferProblems;

/// What can go wrong when a model is asked for.
pub struct ModelProblems;

/// What can go wrong when a model is to serve, or no longer.
pub struct LoadProblems;

/// What can go wrong when the repository is listed.
pub struct IndexProblems;

/// What can go wrong when the service is asked for.
pub struct ServerProblems;

/// What can go wrong when readiness is asked for.
pub struct DrainProblems;

/// What can go wrong where anyone may ask.
pub struct AnyoneProblems;

impl IntoResponses for InferProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        // A frame that is no image is told as a bad request.
        responses(ErrorForm::Oip, frame_kinds().filter(|kind| *kind != Kind::NotAnImage))
    }
}

impl IntoResponses for ModelProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([Kind::BadRequest, Kind::NoSuchModel, Kind::NotReady, Kind::NoModel])
    }
}

impl IntoResponses for LoadProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([
            Kind::BadRequest,
            Kind::NoSuchModel,
            Kind::SlowBody,
            Kind::NotReady,
            Kind::TooLarge,
            Kind::UnsupportedType,
            Kind::QueueFull,
            Kind::Conflict,
            Kind::NoRepository,
            Kind::Internal,
        ])
    }
}

impl IntoResponses for IndexProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([Kind::BadRequest, Kind::SlowBody, Kind::TooLarge, Kind::UnsupportedType, Kind::QueueFull])
    }
}

impl IntoResponses for ServerProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([])
    }
}

impl IntoResponses for DrainProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        responses(ErrorForm::Oip, [Kind::BadRequest, Kind::Draining, Kind::NoModel])
    }
}

impl IntoResponses for AnyoneProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        responses(ErrorForm::Oip, [Kind::BadRequest])
    }
}

fn keyed<const N: usize>(others: [Kind; N]) -> BTreeMap<String, RefOr<Response>> {
    responses(ErrorForm::Oip, AUTH_KINDS.into_iter().chain(others))
}
