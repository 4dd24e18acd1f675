//! The kinds of problem, and what each is to a caller.

/// The kinds of problem, by status: one `type`, title and status each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Malformed query, path or body.
    BadRequest,
    /// Bytes that are no request.
    NotHttp,
    /// No key, or one that nobody has.
    Unauthorized,
    /// A key of the wrong role.
    Forbidden,
    /// A page of another site.
    ForeignSite,
    /// A name that is not known to be the service's.
    UnknownHost,
    /// A robot that another key speaks for.
    RobotOfAnother,
    /// No such path.
    NotFound,
    /// No such model or version.
    NoSuchModel,
    /// Another method.
    MethodNotAllowed,
    /// A body that came too slowly.
    SlowBody,
    /// A version that does not serve.
    NotReady,
    /// Something stands in the way.
    Conflict,
    /// What serves was changed since the caller looked.
    StaleEpoch,
    /// Too many bytes, pixels or frames.
    TooLarge,
    /// A path that is too long.
    PathTooLong,
    /// A type of body that is not read here.
    UnsupportedType,
    /// Bytes that are no image.
    NotAnImage,
    /// Bytes that are no model that works.
    NotAModel,
    /// A call that is no WebSocket.
    NoWebSocket,
    /// No slot is free.
    QueueFull,
    /// Headers that are too long.
    HeadTooLong,
    /// A defect of ours.
    Internal,
    /// The service stops.
    Draining,
    /// Nothing serves.
    NoModel,
    /// The repository of models cannot be used.
    NoRepository,
    /// The service keeps nothing.
    NoData,
    /// The deadline passed.
    DeadlinePassed,
    /// No room is left on the disk.
    DiskFull,
}

/// What a kind is to a caller.
struct Row {
    kind: Kind,
    /// Of HTTP.
    status: u16,
    /// The last part of the `type`, `/problems/NAME`.
    name: &'static str,
    /// What it is, in a few words that never change.
    title: &'static str,
    /// What a caller can do about it, where nothing more exact is known.
    advice: &'static str,
}

/// One row a kind, in their order.
const ROWS: [Row; 29] = [
    Row {
        kind: Kind::BadRequest,
        status: 400,
        name: "bad-request",
        title: "The request is malformed",
        advice: "correct the request as the detail says; /docs describes all of them",
    },
    Row {
        kind: Kind::NotHttp,
        status: 400,
        name: "not-http",
        title: "What came is no HTTP request",
        advice: "send a request of HTTP/1.1 that is well formed; see that the address begins with http:// or https:// as the service is set up",
    },
    Row {
        kind: Kind::Unauthorized,
        status: 401,
        name: "unauthorized",
        title: "A valid key is missing",
        advice: "send a key in the header `Authorization: Bearer KEY`",
    },
    Row {
        kind: Kind::Forbidden,
        status: 403,
        name: "forbidden",
        title: "The key's role may not do this",
        advice: "use a key whose role allows this, or one of an admin",
    },
    Row {
        kind: Kind::ForeignSite,
        status: 403,
        name: "foreign-site",
        title: "A page of another site may not do this",
        advice: "let the operator add the page's origin to the setting `origins`",
    },
    Row {
        kind: Kind::UnknownHost,
        status: 403,
        name: "unknown-host",
        title: "The service does not answer to this name",
        advice: "let the operator add the name to the setting `hosts`, or call an address",
    },
    Row {
        kind: Kind::RobotOfAnother,
        status: 403,
        name: "robot-of-another",
        title: "The key does not speak for this robot",
        advice: "name a robot of the key, or use that robot's key",
    },
    Row {
        kind: Kind::NotFound,
        status: 404,
        name: "not-found",
        title: "There is nothing at this path",
        advice: "see /docs for the paths there are",
    },
    Row {
        kind: Kind::NoSuchModel,
        status: 404,
        name: "no-such-model",
        title: "There is no such model or version",
        advice: "GET /v1/models lists the models there are",
    },
    Row {
        kind: Kind::MethodNotAllowed,
        status: 405,
        name: "method-not-allowed",
        title: "The path does not take this method",
        advice: "use a method of the header Allow",
    },
    Row {
        kind: Kind::SlowBody,
        status: 408,
        name: "slow-body",
        title: "The body came too slowly",
        advice: "send smaller frames, or use a faster connection",
    },
    Row {
        kind: Kind::NotReady,
        status: 409,
        name: "version-not-ready",
        title: "The version does not serve",
        advice: "ask for the version that serves, or for none",
    },
    Row {
        kind: Kind::Conflict,
        status: 409,
        name: "conflict",
        title: "Something stands in the way",
        advice: "look again at what there is, and choose another version, number or name",
    },
    Row {
        kind: Kind::StaleEpoch,
        status: 412,
        name: "stale-epoch",
        title: "What serves was changed in the meantime",
        advice: "look again at what serves, and send its epoch in If-Match",
    },
    Row {
        kind: Kind::TooLarge,
        status: 413,
        name: "too-large",
        title: "Too many bytes, pixels or frames",
        advice: "send fewer bytes, fewer pixels or fewer frames",
    },
    Row {
        kind: Kind::PathTooLong,
        status: 414,
        name: "path-too-long",
        title: "The path is too long",
        advice: "send a shorter path and query; frames belong into the body",
    },
    Row {
        kind: Kind::UnsupportedType,
        status: 415,
        name: "unsupported-type",
        title: "A body of this type is not read here",
        advice: "send the image itself as image/jpeg, or multipart/form-data, or JSON",
    },
    Row {
        kind: Kind::NotAnImage,
        status: 422,
        name: "not-an-image",
        title: "The body is not an image that can be read",
        advice: "send a whole JPEG, PNG, WebP, BMP or PGM image",
    },
    Row {
        kind: Kind::NotAModel,
        status: 422,
        name: "not-a-model",
        title: "The body is not a model that works",
        advice: "send the folder of a version as a tar, or its model.safetensors",
    },
    Row {
        kind: Kind::NoWebSocket,
        status: 426,
        name: "no-websocket",
        title: "The path takes a WebSocket",
        advice: "open a WebSocket with the subprotocol roomsight.v1, for example with websocat",
    },
    Row {
        kind: Kind::QueueFull,
        status: 429,
        name: "queue-full",
        title: "The queue is full",
        advice: "try again after the time in Retry-After, or send fewer frames",
    },
    Row {
        kind: Kind::HeadTooLong,
        status: 431,
        name: "head-too-long",
        title: "The headers are too long",
        advice: "send fewer or shorter headers, at most 100 and 64 KiB in all",
    },
    Row {
        kind: Kind::Internal,
        status: 500,
        name: "internal",
        title: "The service failed",
        advice: "try again; if it stays, give the operator the request id",
    },
    Row {
        kind: Kind::Draining,
        status: 503,
        name: "draining",
        title: "The service is stopping",
        advice: "send the request to another instance, or again in a while",
    },
    Row {
        kind: Kind::NoModel,
        status: 503,
        name: "no-model",
        title: "No model serves",
        advice: "upload or activate a version, or wait until somebody has",
    },
    Row {
        kind: Kind::NoRepository,
        status: 503,
        name: "no-repository",
        title: "The repository of models cannot be used",
        advice: "see that the folder or the bucket of models can be reached and written",
    },
    Row {
        kind: Kind::NoData,
        status: 503,
        name: "no-data-directory",
        title: "The service keeps nothing",
        advice: "start the service with --data FOLDER",
    },
    Row {
        kind: Kind::DeadlinePassed,
        status: 504,
        name: "deadline-passed",
        title: "The deadline passed",
        advice: "allow more time, or send fewer frames",
    },
    Row {
        kind: Kind::DiskFull,
        status: 507,
        name: "disk-full",
        title: "No room is left on the disk",
        advice: "make room where the service keeps its data, then send it again; nothing of this request was kept",
    },
];

impl Kind {
    /// All kinds, by status.
    pub fn all() -> impl Iterator<Item = Self> {
        ROWS.iter().map(|row| row.kind)
    }

    /// The status code of HTTP.
    pub fn status(self) -> u16 {
        self.row().status
    }

    /// The last part of the `type`, `/problems/NAME`.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// What it is, in a few words that never change.
    pub fn title(self) -> &'static str {
        self.row().title
    }

    /// What a caller can do about it, where nothing more exact is known.
    pub fn advice(self) -> &'static str {
        self.row().advice
    }

    /// The URI path that names the kind.
    pub fn uri(self) -> String {
        format!("/problems/{}", self.name())
    }

    /// The first kind of this status; where there is none, a defect of ours from 500 on, and else of the request.
    pub fn from_status(status: u16) -> Self {
        let fallback = if status >= 500 { Self::Internal } else { Self::BadRequest };
        Self::all().find(|kind| kind.status() == status).unwrap_or(fallback)
    }

    fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_the_row_of_its_place_and_a_name_of_its_own() {
        for (row_idx, row) in ROWS.iter().enumerate() {
            assert_eq!(row.kind as usize, row_idx);
            assert!(ROWS[..row_idx].iter().all(|other| other.name != row.name), "{}", row.name);
            assert!((400..600).contains(&row.status), "{}", row.name);
        }
        assert!(ROWS.is_sorted_by_key(|row| row.status));
    }

    #[test]
    fn a_status_without_a_kind_is_the_callers_fault_or_ours() {
        for (status, kind) in [
            (404, Kind::NotFound),
            (405, Kind::MethodNotAllowed),
            (418, Kind::BadRequest),
            (502, Kind::Internal),
        ] {
            assert_eq!(Kind::from_status(status), kind);
        }
    }
}
