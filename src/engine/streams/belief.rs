//! What a stream's frames say together: its filter, here and for another process.

use super::moment::{Moment, SealedMoment};
use roomsight_protocol::stream::FilterSettings;
use roomsight_recognition::filter::{RoomFilter, Trust};
use roomsight_recognition::model::Pose;
use serde::{Deserialize, Serialize};

/// A filter, and the frame it last took in.
pub struct Belief {
    pub filter: RoomFilter,
    pub settings: FilterSettings,
    pub at: Moment,
    /// Where the robot was then, by its wheels.
    pub odometry: Option<Pose>,
}

/// The same as another process understands it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SealedBelief {
    rooms: Vec<f32>,
    elsewhere: Option<f32>,
    settings: FilterSettings,
    at: SealedMoment,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    odometry: Option<Pose>,
}

impl Belief {
    /// For another process.
    pub fn sealed(&self) -> SealedBelief {
        SealedBelief {
            rooms: self.filter.belief().to_vec(),
            elsewhere: self.filter.novelty(),
            settings: self.settings,
            at: self.at.sealed(),
            odometry: self.odometry,
        }
    }
}

impl SealedBelief {
    /// Of another process; none where it is not of so many rooms.
    pub fn opened(self, n_rooms: usize) -> Option<Belief> {
        let Self { rooms, elsewhere, settings, at, odometry } = self;
        let trust = Trust::try_from(settings.trust).ok()?;
        let filter = RoomFilter::restored(rooms, elsewhere, trust)?;
        let is_of_rooms = filter.belief().len() == n_rooms;
        is_of_rooms.then(|| Belief { filter, settings, at: Moment::opened(at), odometry })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_filter_goes_on_bit_for_bit(
            weights in prop::collection::vec(0.001..1.0_f32, 1..40), elsewhere in prop::option::of(0.0..=1.0_f32),
        ) {
            let sum: f32 = weights.iter().sum();
            let rooms: Vec<f32> = weights.iter().map(|weight| weight / sum).collect();
            let filter = RoomFilter::restored(rooms.clone(), elsewhere, Trust::default()).unwrap();
            let at = Moment::opened(serde_json::from_str(r#"{"captured_at_ns":9,"arrived_ms":1}"#).unwrap());
            let odometry = Some(Pose { x: 1.5, y: -2.0, angle: 0.1 });
            let settings = FilterSettings::default();
            let sealed = Belief { filter: filter.clone(), settings, at, odometry }.sealed();
            let back: SealedBelief = serde_json::from_slice(&serde_json::to_vec(&sealed).unwrap()).unwrap();
            let opened = back.clone().opened(rooms.len()).unwrap();
            prop_assert_eq!((opened.filter, opened.odometry), (filter, odometry));
            prop_assert!(back.opened(rooms.len() + 1).is_none());
        }
    }
}
