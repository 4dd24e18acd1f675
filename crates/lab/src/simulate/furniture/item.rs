//! The pieces of furniture there are.

use super::{office, utility};
use crate::simulate::builder::Builder;

/// A piece of furniture. It is built with its back at local y = 0, its front toward +y, x in the middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::simulate) enum Item {
    Bin,
    Bookshelf,
    Boxes,
    Chair,
    CoatRack,
    ConferenceTable,
    Counter,
    Cupboard,
    Desk,
    DiningTable,
    Extinguisher,
    MobileRobot,
    Plant,
    Printer,
    Rack,
    Refrigerator,
    Sofa,
    Stairs,
    Stall,
    Terminal,
    Urinal,
    Washbasin,
    Whiteboard,
    Workbench,
}

impl Item {
    /// Width and depth of the floor it takes and the height of wall that it hides, in meters.
    fn size(self) -> [f32; 3] {
        match self {
            Self::Bin => [0.4, 0.35, 0.5],
            Self::Bookshelf => [0.95, 0.32, 2.0],
            Self::Boxes => [0.6, 0.5, 0.8],
            Self::Chair => [0.55, 0.6, 0.8],
            Self::CoatRack => [0.5, 0.4, 1.8],
            Self::ConferenceTable => [1.2, 1.1, 0.75],
            Self::Counter => [1.8, 0.62, 0.9],
            Self::Cupboard => [0.9, 0.45, 1.3],
            Self::Desk => [1.5, 0.78, 0.8],
            Self::DiningTable => [1.0, 0.8, 0.75],
            Self::Extinguisher => [0.25, 0.2, 1.1],
            Self::MobileRobot => [0.6, 0.6, 0.8],
            Self::Plant => [0.5, 0.5, 0.8],
            Self::Printer => [0.75, 0.65, 0.8],
            Self::Rack => [0.65, 0.75, 1.9],
            Self::Refrigerator => [0.62, 0.62, 1.7],
            Self::Sofa => [1.7, 0.8, 0.8],
            Self::Stairs => [2.5, 1.15, 0.8],
            Self::Stall => [0.95, 1.15, 0.8],
            Self::Terminal => [0.95, 0.75, 0.8],
            Self::Urinal => [0.65, 0.35, 1.1],
            Self::Washbasin => [1.1, 0.5, 1.9],
            Self::Whiteboard => [1.6, 0.1, 2.0],
            Self::Workbench => [1.5, 0.75, 0.8],
        }
    }

    /// How much of the wall it takes, in meters.
    pub fn width(self) -> f32 {
        self.size()[0]
    }

    /// How far it stands out from the wall, in meters, without chairs.
    pub fn depth(self) -> f32 {
        self.size()[1]
    }

    /// Up to what height it needs a wall without openings, in meters.
    pub fn height(self) -> f32 {
        self.size()[2]
    }

    /// Whether people push it about or take it away.
    pub fn is_movable(self) -> bool {
        matches!(self, Self::Bin | Self::Boxes | Self::Chair | Self::MobileRobot | Self::Plant)
    }

    /// Builds it where the builder is.
    pub fn build(self, b: &mut Builder) {
        match self {
            Self::Bin => office::bin(b),
            Self::Bookshelf => office::bookshelf(b),
            Self::Boxes => utility::boxes(b),
            Self::Chair => office::chair(b, 0.3),
            Self::CoatRack => office::coat_rack(b),
            Self::ConferenceTable => office::conference_table(b),
            Self::Counter => utility::counter(b),
            Self::Cupboard => office::cupboard(b),
            Self::Desk => office::desk(b, self.width()),
            Self::DiningTable => utility::dining_table(b),
            Self::Extinguisher => utility::extinguisher(b),
            Self::MobileRobot => utility::mobile_robot(b),
            Self::Plant => office::plant(b),
            Self::Printer => utility::printer(b),
            Self::Rack => utility::rack(b),
            Self::Refrigerator => utility::refrigerator(b),
            Self::Sofa => office::sofa(b),
            Self::Stairs => utility::stairs(b),
            Self::Stall => utility::stall(b),
            Self::Terminal => office::desk(b, self.width()),
            Self::Urinal => utility::urinal(b),
            Self::Washbasin => utility::washbasin(b),
            Self::Whiteboard => office::whiteboard(b),
            Self::Workbench => utility::workbench(b),
        }
    }
}
