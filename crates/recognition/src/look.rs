//! How frames are looked at, and what is seen.
//!
//! | file | what |
//! |---|---|
//! | `sight` | the ways to look, and what each sees |
//! | `local` | keypoints and what describes them |
//! | `lens` | looking through a network |
//! | `scan`, `laser` | what a laser measures beside a picture, and the shape of the space that it tells |
//! | `flaw` | frames that show nothing |
//! | `features` | what a frame shows, before it is classified |

pub(crate) mod features;
pub(crate) mod flaw;
pub(crate) mod laser;
pub(crate) mod lens;
pub(crate) mod local;
pub(crate) mod scan;
pub(crate) mod sight;
