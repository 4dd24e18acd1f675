//! Who may call: keys, their roles, and pages of other sites.
//!
//! | file | what |
//! |---|---|
//! | `key` | a key: its role, its name, its robots |
//! | `keyring` | the keys that are valid now, and the sessions made from them |
//! | `seal` | what callers keep for the service, sealed |
//! | `site` | names of the service, and pages that may call it |

mod key;
mod keyring;
mod seal;
mod site;

pub use key::{Key, KeyError, Role, check_together};
pub use keyring::Keyring;
pub use seal::Seals;
pub use site::{SiteError, Sites};

use crate::problem::{Kind, Problem};

/// Why a caller was turned away.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum AuthError {
    /// No key was sent.
    #[error("send a key in the header `Authorization: Bearer KEY`")]
    Missing,
    /// A key that nobody has.
    #[error("the key is not known here; check it, or ask the operator for one")]
    Unknown,
    /// A session that is over, or never was.
    #[error("the session is over; sign in again: POST /v1/session with a key")]
    Session,
    /// A code that was used, or that nobody was told.
    #[error("the code is used up or too old; let the service print another one, or sign in with a key")]
    Code,
    /// A name that is not known to be ours, on a service without keys.
    #[error(
        "without keys the service does not answer to the name {0:?}: add it to the setting `hosts`, call the \
         service by its address, or give it keys"
    )]
    Host(String),
    /// A page of another site, in a browser that can reach a service without keys or has a session.
    #[error(
        "a page of another site ({0:?}) may not do this here: add its origin to the setting `origins`; \
         where it is a page of this service behind a proxy, let the proxy pass the header Host"
    )]
    Origin(String),
    /// A key whose role does not allow this.
    #[error("a key with the role {has} may not do this; it takes the role {}", either(.needs))]
    Forbidden {
        /// The role of the key that was sent.
        has: Role,
        /// The roles that would do beside admin.
        needs: &'static [Role],
    },
    /// A robot that another key is bound to, or that is not one of those of the caller's key.
    #[error("the key does not speak for the robot {0:?}; name one of its own, or use that robot's key")]
    Robot(String),
}

impl From<AuthError> for Problem {
    fn from(error: AuthError) -> Self {
        let kind = match &error {
            AuthError::Missing | AuthError::Unknown | AuthError::Session | AuthError::Code => {
                Kind::Unauthorized
            }
            AuthError::Forbidden { .. } => Kind::Forbidden,
            AuthError::Origin(_) => Kind::ForeignSite,
            AuthError::Host(_) => Kind::UnknownHost,
            AuthError::Robot(_) => Kind::RobotOfAnother,
        };
        Self::new(kind, error)
    }
}

fn either(roles: &[Role]) -> String {
    roles.iter().chain([&Role::Admin]).map(Role::to_string).collect::<Vec<_>>().join(" or ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_roles_that_would_do_are_named() {
        let text = |needs| AuthError::Forbidden { has: Role::Robot, needs }.to_string();
        assert!(text(&[Role::Viewer]).ends_with("it takes the role viewer or admin"));
        assert!(text(&[]).ends_with("it takes the role admin"), "{}", text(&[]));
    }
}
