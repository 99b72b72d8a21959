//! What the supply leaves of what a motor is asked to do: a stage between its placement and its bridge.

use crate::braking::{OperatingPoint, Placement, Placer};
use crate::bridge::Drive;
use crate::units::Share;

/// The bounds, and the placement that they are put on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// How much may be drawn.
    draw: Share,
    /// How far returned energy is to be burnt.
    burn: Share,
    /// At the last tick, with what could be drawn then; `None` while the motor coasts.
    placed: Option<(OperatingPoint, Placement)>,
    /// The same within the bounds of now.
    bounded: Option<(OperatingPoint, Placement)>,
    /// The bridge does something else than was asked for.
    intervenes: bool,
}

impl Bounds {
    /// None.
    pub(super) const NONE: Self =
        Self { draw: Share::ALL, burn: Share::NONE, placed: None, bounded: None, intervenes: false };

    /// Takes a tick's placement; says what the bridge does.
    pub(super) fn place(
        &mut self,
        placer: &Placer,
        placed: Option<(OperatingPoint, Placement)>,
    ) -> Option<(OperatingPoint, Placement)> {
        self.placed = placed;
        self.bounded = placed.map(|(at, placement)| {
            let drawing = placer.drawing_at_most(placement, self.draw, at);
            (at, placer.burning(drawing, self.burn, at))
        });
        self.intervenes = (self.draw, self.burn) != (Share::ALL, Share::NONE) && self.bounded != self.placed;
        self.bounded
    }

    /// How much may be drawn.
    pub(super) const fn draw(&self) -> Share {
        self.draw
    }

    /// So much may be drawn, and so far returned energy is to be burnt, from now on. True if the bridge is told
    /// otherwise for it. More than at the last tick is drawn from the next one on.
    pub(super) fn allow(&mut self, placer: &Placer, draw: Share, burn: Share) -> bool {
        if (draw, burn) == (self.draw, self.burn) {
            return false;
        }
        (self.draw, self.burn) = (draw, burn);
        let before = self.drive();
        self.place(placer, self.placed);
        self.drive() != before
    }

    /// What the bridge does, if it is not open.
    pub(super) const fn bounded(&self) -> Option<(OperatingPoint, Placement)> {
        self.bounded
    }

    /// True if the bridge does something else than was asked for.
    pub(super) const fn intervenes(&self) -> bool {
        self.intervenes
    }

    /// What the bridge is told.
    pub(super) const fn drive(&self) -> Drive {
        match self.bounded {
            Some((_, placement)) => placement.drive,
            None => Drive::COAST,
        }
    }
}
