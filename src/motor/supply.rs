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
    /// All may be drawn, and nothing is to be burnt.
    none: bool,
    /// At the last tick, with what could be drawn then; `None` while the motor coasts.
    placed: Option<Placement>,
    /// The same within the bounds of now, where there are any.
    bounded: Option<Placement>,
}

impl Bounds {
    /// None.
    pub(super) const NONE: Self =
        Self { draw: Share::ALL, burn: Share::NONE, none: true, placed: None, bounded: None };

    /// Takes a tick's placement; says what the bridge does.
    pub(super) fn place(&mut self, placer: &Placer, at: OperatingPoint, placed: Placement) -> Placement {
        self.placed = Some(placed);
        if self.none {
            return placed;
        }
        let bounded = self.bound(placer, at, placed);
        self.bounded = Some(bounded);
        bounded
    }

    fn bound(&self, placer: &Placer, at: OperatingPoint, placed: Placement) -> Placement {
        placer.burning(placer.drawing_at_most(placed, self.draw, at), self.burn, at)
    }

    /// The bridge is open until a placement is taken.
    pub(super) const fn let_go(&mut self) {
        (self.placed, self.bounded) = (None, None);
    }

    /// True if all is allowed.
    pub(super) const fn are_none(&self) -> bool {
        self.none
    }

    /// How much may be drawn.
    pub(super) const fn draw(&self) -> Share {
        self.draw
    }

    /// Puts other bounds on the last tick's placement; says what the bridge does if that is something else than
    /// before. More than at the last tick is drawn from the next one on.
    pub(super) fn renew(
        &mut self,
        placer: &Placer,
        at: Option<OperatingPoint>,
        draw: Share,
        burn: Share,
    ) -> Option<Placement> {
        let before = self.drive();
        (self.draw, self.burn) = (draw, burn);
        self.none = (draw, burn) == (Share::ALL, Share::NONE);
        let bounded = self.bound(placer, at?, self.placed?);
        self.bounded = Some(bounded);
        (bounded.drive != before).then_some(bounded)
    }

    /// True if the bridge does something else than was asked for.
    pub(super) fn intervenes(&self) -> bool {
        !self.none && self.bounded != self.placed
    }

    /// What the bridge does, if it is told anything.
    pub(super) const fn bounded(&self) -> Option<Placement> {
        if self.none { self.placed } else { self.bounded }
    }

    /// What the bridge is told.
    pub(super) const fn drive(&self) -> Drive {
        match self.bounded() {
            Some(placement) => placement.drive,
            None => Drive::COAST,
        }
    }
}
