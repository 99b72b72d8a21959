//! Converts keys to motor levels. The functions of this file use neither a clock nor a terminal.

use crate::client::drive::ALL;
use std::time::{Duration, Instant};

/// A key with a meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    Forward,
    Backward,
    Faster,
    Slower,
    /// Chooses one motor.
    One(u8),
    /// Chooses all motors.
    All,
    /// Disables all motors.
    Stop,
    Quit,
}

/// Returns the keys in the bytes of one read from a terminal. Keys without a meaning are left out.
pub(super) fn read(mut bytes: &[u8]) -> Vec<Key> {
    let mut keys = Vec::new();
    while let [first, rest @ ..] = bytes {
        let (key, rest) = match (*first, rest) {
            // Arrow keys, in normal and in application mode of the terminal.
            (0x1B, [b'[' | b'O', arrow, rest @ ..]) => (escaped(*arrow), rest),
            // An escape byte that begins no arrow key is the key Esc, which disables all motors.
            (0x1B, rest) => (Some(Key::Stop), rest),
            (byte, rest) => (plain(byte), rest),
        };
        keys.extend(key);
        bytes = rest;
    }
    keys
}

const fn escaped(arrow: u8) -> Option<Key> {
    match arrow {
        b'A' => Some(Key::Forward),
        b'B' => Some(Key::Backward),
        b'C' => Some(Key::Faster),
        b'D' => Some(Key::Slower),
        _ => None,
    }
}

const fn plain(byte: u8) -> Option<Key> {
    match byte {
        b'k' | b'+' => Some(Key::Forward),
        b'j' | b'-' => Some(Key::Backward),
        b'l' | b'>' => Some(Key::Faster),
        b'h' | b'<' => Some(Key::Slower),
        b'a' => Some(Key::All),
        digit @ b'0'..=b'3' => Some(Key::One(digit - b'0')),
        b' ' => Some(Key::Stop),
        // A raw terminal sends Ctrl-C, Ctrl-D, Ctrl-Z and Ctrl-\ as keys.
        b'q' | 0x03 | 0x04 | 0x1A | 0x1C => Some(Key::Quit),
        _ => None,
    }
}

/// Requested level of all motors, as a function of keys and time.
#[derive(Clone, Debug)]
pub(super) struct Jog {
    /// Chosen motors.
    motors: Vec<u8>,
    level: i16,
    hold: Duration,
    /// Requested level by motor; `None` is disabled.
    wanted: [Option<i16>; ALL.len()],
    /// Time at which turning motors must stop, unless a key is pressed before this time.
    until: Option<Instant>,
}

impl Jog {
    /// Starts with motor 0 chosen. A key press drives at `level` for `hold`.
    pub(super) fn new(level: i16, hold: Duration) -> Self {
        Self { motors: vec![0], level, hold, wanted: [None; ALL.len()], until: None }
    }

    /// Returns the chosen motors.
    pub(super) fn motors(&self) -> &[u8] {
        &self.motors
    }

    /// Returns the level of motors that turn, in counts per second or in steps of power (32767 is full power).
    pub(super) const fn level(&self) -> i16 {
        self.level
    }

    /// Handles a key press.
    pub(super) fn press(&mut self, key: Key, now: Instant) {
        match key {
            Key::Forward => self.go(self.level, now),
            Key::Backward => self.go(-self.level, now),
            Key::Faster => self.level = self.level.saturating_add(self.step()),
            Key::Slower => self.level -= self.step().min(self.level - 1),
            Key::One(motor) => self.choose(vec![motor]),
            Key::All => self.choose(ALL.to_vec()),
            Key::Stop | Key::Quit => (self.wanted, self.until) = ([None; ALL.len()], None),
        }
    }

    /// Returns the change of the level by one key press: a fifth of the level, at least 1.
    fn step(&self) -> i16 {
        (self.level / 5).max(1)
    }

    fn go(&mut self, level: i16, now: Instant) {
        for (motor, wanted) in (0..).zip(&mut self.wanted) {
            if self.motors.contains(&motor) {
                *wanted = Some(level);
            }
        }
        self.until = Some(now + self.hold);
    }

    fn choose(&mut self, motors: Vec<u8>) {
        self.stand();
        self.motors = motors;
    }

    /// Sets the level of all enabled motors to 0.
    fn stand(&mut self) {
        self.wanted = self.wanted.map(|wanted| wanted.map(|_| 0));
        self.until = None;
    }

    /// Returns the requested level by motor at `now`; `None` is disabled.
    pub(super) fn at(&mut self, now: Instant) -> [Option<i16>; ALL.len()] {
        if self.until.is_some_and(|until| now >= until) {
            self.stand();
        }
        self.wanted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_read_from_the_bytes_of_terminals() {
        use Key::*;
        assert_eq!(read(b"\x1b[A\x1bOB\x1b[C\x1b[D"), [Forward, Backward, Faster, Slower]);
        assert_eq!(
            read(b"kjlh+->< aq\x03"),
            [Forward, Backward, Faster, Slower, Forward, Backward, Faster, Slower, Stop, All, Quit, Quit]
        );
        assert_eq!(read(b"034x\x1b[Z\xff"), [One(0), One(3)]);
        assert_eq!(read(b"\x1b"), [Stop]);
    }

    #[test]
    fn a_motor_turns_while_a_key_is_held_and_stands_after_it() {
        let (begin, ms) = (Instant::now(), Duration::from_millis);
        let mut jog = Jog::new(300, ms(700));
        assert_eq!(jog.at(begin), [None; 4]);
        jog.press(Key::Forward, begin);
        assert_eq!(jog.at(begin + ms(699)), [Some(300), None, None, None]);
        jog.press(Key::Forward, begin + ms(600));
        assert_eq!(jog.at(begin + ms(1299)), [Some(300), None, None, None]);
        assert_eq!(jog.at(begin + ms(1300)), [Some(0), None, None, None]);
        jog.press(Key::Backward, begin + ms(1400));
        assert_eq!(jog.at(begin + ms(1400)), [Some(-300), None, None, None]);
        // When another motor is chosen, the first motor gets level 0 and stays enabled until Stop.
        jog.press(Key::One(2), begin + ms(1500));
        jog.press(Key::Faster, begin + ms(1500));
        jog.press(Key::Forward, begin + ms(1500));
        assert_eq!(jog.at(begin + ms(1500)), [Some(0), None, Some(360), None]);
        jog.press(Key::Stop, begin + ms(1600));
        assert_eq!(jog.at(begin + ms(1600)), [None; 4]);
    }

    #[test]
    fn levels_stay_within_their_range() {
        let mut jog = Jog::new(i16::MAX - 5, Duration::from_secs(1));
        jog.press(Key::Faster, Instant::now());
        assert_eq!(jog.level(), i16::MAX);
        (0..200).for_each(|_| jog.press(Key::Slower, Instant::now()));
        assert_eq!(jog.level(), 1);
    }
}
