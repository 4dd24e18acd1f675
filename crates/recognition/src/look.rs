//! How frames are looked at, and what is seen.
//!
//! | file | what |
//! |---|---|
//! | `sight` | the ways to look, and what each sees |
//! | `local` | keypoints and what describes them |
//! | `lens` | looking through a network |
//! | `flaw` | frames that show nothing |
//! | `features` | what a frame shows, before it is classified |

pub(crate) mod features;
pub(crate) mod flaw;
pub(crate) mod lens;
pub(crate) mod local;
pub(crate) mod sight;
