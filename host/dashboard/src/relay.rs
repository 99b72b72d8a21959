//! The relay owns the session with the hub. The relay reads the motors' state 50 times per second, sends frames to all
//! pages, and executes orders as they arrive. The server runs the relay in a thread. Without a server the relay runs in
//! the browser of its page. Motors run only while the page in control is open: see [`pages`](crate::pages).

use crate::chain::{Chain, FRAMES_PER_QUERY};
use crate::devices::{Devices, analog, has, servos};
use crate::executor::Executor;
use crate::frame::{Frame, Message, catalogue, fault_entry, points, status};
use crate::hub::{Opened, RequestError, channel, or_refusal};
use crate::identification::{Identification, Progress};
use crate::outbox::Outbox;
use crate::pages::Pages;
use crate::place::Place;
use crate::requests::{Look, PageRequest};
use crate::scenario_player::{Playing, Script};
use crate::settings_file;
use crate::update::{self, bytes_of};
use crate::world::World;
use motor_hub::extension::HubFunction;
use motor_hub::protocol::{Address, CHANNELS};
use motor_hub_client::clock::Instant;
use motor_hub_client::hub::StoreAccess;
use motor_hub_client::reasons::why_unsaved;
use motor_hub_client::update::{LARGEST_IMAGE, Updating};
use motor_hub_client::{Error, Session};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

/// Interval between frames.
pub const INTERVAL: Duration = Duration::from_millis(20);

/// Time-out of the hub's answers. The time-out is short, so that a stop or the loss of a page is handled soon.
const REQUEST_TIMEOUT: Duration = Duration::from_millis(300);

/// Interval between attempts to connect to a lost hub.
const RECONNECT_INTERVAL: Duration = Duration::from_secs(1);

/// Interval between reads of enabled motors and set-points from a hub that has no reports.
const SETPOINT_POLL_INTERVAL: Duration = Duration::from_millis(200);

/// An event of a page, with the page's number.
#[derive(Debug)]
pub enum Event {
    /// The page was opened. The outbox sends texts to the page.
    Joined(u32, Outbox),
    /// The page was closed.
    Left(u32),
    /// The page has sent an order, as JSON.
    Ordered(u32, String),
}

/// Owns the session with the hub, executes orders, and sends messages to all pages.
pub struct Relay {
    place: Place,
    senders: BTreeMap<u32, Outbox>,
    pages: Pages,
    session: Option<Session>,
    chain: Chain,
    executor: Executor,
    devices: Devices,
    identification: Option<Identification>,
    playing: Option<Playing>,
    /// The running save, load or reset of settings; `None` if none is running.
    saving: Option<(HubFunction, StoreAccess)>,
    /// Parts of new firmware that a page has sent.
    firmware: Vec<u8>,
    update: Option<Updating>,
    /// The newest frame.
    frame: Frame,
    /// Number of resets of the shown hub in this session that were handled.
    resets: u32,
    /// Time at which the frames' clock started.
    since: Instant,
    /// Time of the next attempt to connect.
    connect_at: Instant,
    /// Time at which enabled motors and set-points of a hub without reports were read last.
    looked_at: Instant,
    /// Time at which the shown hub was connected, was reset, or replaced a lost hub. `None` before the first connection.
    hub_changed_at: Option<Instant>,
    /// Newest message about the line, for new pages.
    line: Message,
    /// Newest settings by motor, for new pages.
    settings: BTreeMap<u8, Arc<str>>,
}

impl Relay {
    /// Creates the relay of the hub at `place`. The relay has no pages yet.
    pub fn new(place: Place) -> Self {
        let now = Instant::now();
        let line = gone("not connected yet".to_owned());
        Self {
            place,
            senders: BTreeMap::new(),
            pages: Pages::new(),
            session: None,
            chain: Chain::default(),
            executor: Executor::default(),
            devices: Devices::default(),
            identification: None,
            playing: None,
            saving: None,
            firmware: Vec::new(),
            update: None,
            frame: Frame::default(),
            resets: 0,
            since: now,
            connect_at: now,
            looked_at: now,
            hub_changed_at: None,
            line,
            settings: BTreeMap::new(),
        }
    }

    /// Handles an event of a page.
    pub fn handle(&mut self, event: Event) {
        let now = Instant::now();
        match event {
            Event::Joined(id, outbox) => self.welcome(id, outbox, now),
            Event::Left(id) => {
                self.senders.remove(&id);
                if let Some(gone) = self.pages.leave(id) {
                    self.switch_off_if_any(&gone.to_string());
                }
                self.send_control();
            }
            Event::Ordered(id, text) => {
                let order = serde_json::from_str(&text).map_err(|error| format!("not an order: {error}"));
                if let Err(why) = order.and_then(|order| self.execute(id, &order, now)) {
                    self.answer(id, &Message::Refused { why });
                }
            }
        }
    }

    fn welcome(&mut self, id: u32, outbox: Outbox, now: Instant) {
        self.pages.join(id, now);
        let Place { name, world, script, .. } = &self.place;
        let welcome = Message::Welcome {
            you: id,
            place: name.clone(),
            simulated: world.is_some(),
            playable: script.is_some(),
            catalogue: catalogue(),
        };
        let mut first = vec![welcome.text(), self.line.text()];
        first.extend(self.chain.several().map(|hubs| Message::Hubs { hubs: hubs.to_vec() }.text()));
        first.extend(self.settings.values().cloned());
        first.extend(world.iter().map(|world| Message::World(world.state()).text()));
        for text in first {
            // If the page is closed already, an event `Left` follows.
            outbox.send(text);
        }
        self.senders.insert(id, outbox);
        self.send_control();
    }

    /// Executes an order of a page.
    ///
    /// # Errors
    /// A text that says why the order is not executed.
    fn execute(&mut self, id: u32, order: &PageRequest, now: Instant) -> Result<(), String> {
        match *order {
            PageRequest::Shown { number } => self.pages.shown(id, number),
            PageRequest::Hidden { hidden } => self.pages.hide(id, hidden, now),
            PageRequest::Stop => self.switch_off("stopped"),
            PageRequest::Take => {
                if self.pages.take(id, now) {
                    self.answer(id, &notice("the page in control is asked to release control".to_owned()));
                }
                self.send_control();
            }
            PageRequest::Release => {
                if self.pages.release(id) {
                    self.switch_off_if_any("control was released");
                }
                self.send_control();
            }
            PageRequest::Points { .. }
            | PageRequest::Faults
            | PageRequest::Export
            | PageRequest::Status
            | PageRequest::Look(_) => {
                let answer = self.look_up(order).map_err(|error| error.to_string())?;
                self.answer(id, &answer);
            }
            _ if self.pages.controller() != Some(id) => return Err("this page is not in control".to_owned()),
            // The order may be meant for a lost hub, or for the state of the hub before a loss or a reset. It would move a
            // motor of the hub that is shown now.
            _ if self.hub_changed_at.is_some_and(|at| !self.pages.has_shown_since(id, at)) => {
                return Err(
                    "the page has not shown the hub since the hub was connected, was reset, or replaced a lost hub: look at its values, then repeat the order"
                        .to_owned(),
                );
            }
            _ => {
                self.execute_for_controller(order)?;
                if let Some(text) = order.done() {
                    self.answer(id, &notice(text));
                }
            }
        }
        Ok(())
    }

    /// Answers an order that only reads.
    fn look_up(&mut self, order: &PageRequest) -> Result<Message, RequestError> {
        let session = self.session.as_mut().ok_or("the hub is not connected")?;
        Ok(match *order {
            PageRequest::Points { motor, scheme, cps, volts } => {
                let settings = session.settings(channel(motor)?)?;
                Message::Points(points(&settings.motor.winding, scheme.0, cps, volts)?)
            }
            PageRequest::Faults => {
                let (_, heads) = session.recorded()?.ok_or("this hub keeps no record of faults")?;
                Message::Faults { entries: heads.iter().map(fault_entry).collect() }
            }
            PageRequest::Status => Message::Status(status(session)?),
            PageRequest::Look(Look::Servos) => Message::Servos { servos: servos(session)? },
            PageRequest::Look(Look::Analog) => Message::Analog { channels: analog(session)? },
            PageRequest::Look(Look::Pins) => Message::Pins { pins: self.devices.pins(session)? },
            _ => Message::File { name: "motor-hub-settings.toml", text: settings_file::export(session)? },
        })
    }

    /// Executes an order of the page in control.
    ///
    /// # Errors
    /// A text that says why the order is not executed.
    fn execute_for_controller(&mut self, order: &PageRequest) -> Result<(), String> {
        // An order since the last frame may have enabled a motor.
        if let PageRequest::Import { .. } | PageRequest::ResetEncoder { .. } = order
            && let Err(error) = self.look_again()
        {
            self.handle_error(&error);
            return Err(error.to_string());
        }
        let Some(session) = &mut self.session else { return Err("the hub is not connected".to_owned()) };
        let done = match *order {
            // A file may change the kind of an enabled motor's set-point. Then the motor would follow an old value of
            // the new kind.
            PageRequest::Import { .. } if self.frame.motors.iter().any(|motor| motor.enabled) => {
                Err("a motor is enabled: disable all motors by STOP, then import the file again".into())
            }
            PageRequest::ResetEncoder { motor } if self.frame.holds_position(motor) => {
                Err(format!("motor {motor} holds a position, and would travel to its target from the new zero: switch the motor off first").into())
            }
            _ if let Some(Identification { motor, .. }) = self.identification
                && order.disturbs_identification(motor) =>
            {
                Err(format!("motor {motor} is being identified: wait for its end, or press STOP").into())
            }
            PageRequest::Identify { .. } if self.playing.is_some() => {
                Err("a scenario is being played: wait for its end, or press STOP".into())
            }
            PageRequest::Identify { motor, travel } => {
                let begun = channel(motor).and_then(|motor| Identification::begin(session, motor, travel));
                begun.map(|identification| self.identification = Some(identification))
            }
            PageRequest::Play if !self.chain.shows_the_first() => {
                Err("the scenario belongs to the first hub: show the first hub".into())
            }
            PageRequest::Play => match (&self.place.world, &self.place.script) {
                (Some(world), Some(_)) => {
                    world.restart();
                    self.playing = Some(Script::begin());
                    Ok(())
                }
                _ => Err("there is no scenario to play: start the dashboard with --scenario FILE. The scenario must have set-points, and must not move motors in step".into()),
            },
            PageRequest::Firmware { offset, ref hex } => self.collect(offset, hex),
            // The update restarts the hub. A hub that is silent during its restart counts as lost, except the first
            // hub.
            PageRequest::Update { .. } if !self.chain.shows_the_first() => {
                Err("only the first hub can be updated here: start the dashboard with --address of the other hub"
                    .into())
            }
            PageRequest::Update { .. } if self.update.is_some() => {
                Err("an update is running: wait for its end, then send the file again".into())
            }
            PageRequest::Update { ref version, ref seal } => {
                let image = std::mem::take(&mut self.firmware);
                update::begin(session, image, version, seal.as_ref()).map(|update| self.update = Some(update))
            }
            PageRequest::Address { new } => self.set_address(new),
            PageRequest::Hub { address } => self.show(address),
            PageRequest::World(_) if !self.chain.shows_the_first() => {
                Err("only motors and battery of the first hub can be changed: show that hub".into())
            }
            PageRequest::Device(ref order) => self.devices.execute(session, order).map(|transfer| {
                if let Some(transfer) = transfer {
                    self.send_to_all(&Message::Transfer(transfer));
                }
            }),
            PageRequest::Save => self.store(HubFunction::Save),
            PageRequest::Load => self.store(HubFunction::Load),
            PageRequest::Reset => self.store(HubFunction::Reset),
            _ => self.executor.execute(session, self.place.world.as_ref(), order),
        };
        match &done {
            Err(RequestError::Hub(error)) => self.handle_error(error),
            _ => {
                if let Err(error) = self.send_changes(order) {
                    self.handle_error(&error);
                }
            }
        }
        done.map_err(|error| error.to_string())
    }

    /// Sends what an order has changed. Part of a refused order may have been executed too. Settings that have not
    /// changed are not sent, because pages would replace what their users have typed.
    fn send_changes(&mut self, order: &PageRequest) -> Result<(), Error> {
        match order {
            PageRequest::Import { .. } => self.send_all_settings(),
            PageRequest::World(_) | PageRequest::Play => {
                if let Some(world) = self.place.world.as_ref().map(World::state) {
                    self.send_to_all(&Message::World(world));
                }
                Ok(())
            }
            order => order.changed_motor().map_or(Ok(()), |motor| self.send_settings(motor)),
        }
    }

    /// Appends a part of new firmware.
    fn collect(&mut self, offset: usize, hex: &str) -> Result<(), RequestError> {
        if offset == 0 {
            self.firmware.clear();
        }
        let bytes = bytes_of(hex).ok_or("the part has other signs than pairs of hexadecimal digits")?;
        if offset != self.firmware.len() || offset + bytes.len() > LARGEST_IMAGE {
            return Err(format!(
                "a part of the firmware is for byte {offset}, but must be for byte {}; an image has at most {LARGEST_IMAGE} bytes",
                self.firmware.len()
            )
            .into());
        }
        self.firmware.extend(bytes);
        Ok(())
    }

    /// Continues a running update.
    fn go_on_updating(&mut self) -> Result<(), Error> {
        let Some(update) = &mut self.update else { return Ok(()) };
        let progress = match &mut self.session {
            Some(session) => update::go_on(update, session)?,
            None => update.late().map(|why| update::failed(update, why)),
        };
        let Some(progress) = progress else { return Ok(()) };
        let ends = progress.state != "running";
        self.send_to_all(&Message::Update(progress));
        if ends {
            self.update = None;
            // The new firmware may have other settings than the former firmware.
            self.send_all_settings()?;
        }
        Ok(())
    }

    /// Gives the hub another address. A notice to all pages says how long the hub keeps the address.
    fn set_address(&mut self, new: i64) -> Result<(), RequestError> {
        let Some(session) = &mut self.session else { return Ok(()) };
        let address = u8::try_from(new).ok().and_then(Address::new);
        let address = address.ok_or_else(|| format!("an address is {new}; allowed is 1 to 254"))?;
        if self.chain.has_other(address.get()) {
            return Err(format!("another hub of the chain has address {new}: choose another address").into());
        }
        session.set_address(address)?;
        self.chain.rename(address.get());
        // The next session begins at the new address, unless it is for the parent.
        self.place.address = self.place.address.and(Some(address));
        let kept = session.why_address_is_lost()?;
        let kept = kept
            .unwrap_or_else(|| "also after a reset; the stored settings of the motors are kept".to_owned());
        self.send_notice(format!("the hub has address {new} {kept}"), false);
        Ok(())
    }

    /// Begins to save, load or reset the stored settings.
    ///
    /// # Errors
    /// The last save, load or reset was not reported yet: its end sends the settings to the pages.
    fn store(&mut self, what: HubFunction) -> Result<(), RequestError> {
        if self.saving.is_some() {
            return Err("a save, load or reset is running: wait for its end".into());
        }
        let Some(session) = &mut self.session else { return Ok(()) };
        let access = session.begin_store(what.clone())?;
        self.saving = Some((what, access));
        Ok(())
    }

    /// Checks the page in control, reads the hub's state, and sends a frame. The caller calls this function every
    /// [`INTERVAL`].
    pub fn tick(&mut self) {
        self.watch();
        if self.session.is_none() && Instant::now() >= self.connect_at {
            self.connect();
        }
        if let Err(error) = self.step() {
            self.handle_error(&error);
        }
    }

    /// Reads the hub's state, sends a frame, and continues what runs: an update, an identification, a save, a scan, a
    /// scenario.
    fn step(&mut self) -> Result<(), Error> {
        self.go_on_updating()?;
        if !self.look()? {
            return Ok(());
        }
        let now = Instant::now();
        self.frame.at_s = now.saturating_duration_since(self.since).as_secs_f64();
        self.frame.number += 1;
        self.pages.sent(self.frame.number, now);
        let text = Message::Frame(self.frame.clone()).text();
        self.senders.retain(|_, outbox| outbox.show(text.clone()));
        // Without a page in control no motor may run.
        if self.pages.controller().is_none() && self.motors_run() {
            self.switch_off("motors ran, but no page was in control");
        }
        if self.frame.number.is_multiple_of(FRAMES_PER_QUERY) {
            self.identify()?;
            self.follow_save()?;
        }
        self.follow_chain()?;
        self.play()
    }

    /// True if a motor of any hub was enabled when the hub was last asked.
    fn motors_run(&self) -> bool {
        self.frame.motors.iter().any(|motor| motor.enabled) || self.chain.others_run()
    }

    /// Continues a scan of an I2C bus, and asks another hub of the chain which motors are enabled. Sends the results to
    /// the pages.
    fn follow_chain(&mut self) -> Result<(), Error> {
        let Some(session) = &mut self.session else { return Ok(()) };
        let found = self.devices.go_on(session)?;
        self.chain.ask_another(session, self.frame.number)?;
        let back = self.chain.ask_lost(session, self.frame.number)?;
        let motors = || (0..).zip(&self.frame.motors).filter(|(_, motor)| motor.enabled);
        let fault = motors().any(|(_, motor)| motor.fault == Some(true));
        self.chain.note(motors().map(|(motor, _)| motor).collect(), fault);
        let news = self.chain.changed_hubs().map(|hubs| Message::Hubs { hubs });
        let found = found.map(Message::Transfer);
        let back = back.map(|hub| notice(format!("hub {hub} answers again, with its motors disabled")));
        found.into_iter().chain(news).chain(back).for_each(|message| self.send_to_all(&message));
        Ok(())
    }

    /// Handles an error of the exchange with a hub. A child of a chain that does not answer counts as lost, and the
    /// session continues with the other hubs. Any other error drops the session.
    fn handle_error(&mut self, error: &Error) {
        let Some(session) = &mut self.session else { return };
        let shown = session.address();
        let lost = match *error {
            Error::Silent { address } if self.chain.lose(session, address) => address,
            _ => return self.drop_session(&error.to_string()),
        };
        self.send_notice(error.to_string(), lost == shown);
        if lost == shown {
            self.hub_changed_at = Some(Instant::now());
            (self.identification, self.playing) = (None, None);
            self.lose_save(&error.to_string());
            if let Err(error) = self.query_hub() {
                self.handle_error(&error);
            }
        }
    }

    /// Shows another hub of the chain.
    fn show(&mut self, address: u8) -> Result<(), RequestError> {
        let Some(session) = &mut self.session else { return Ok(()) };
        if self.identification.is_some()
            || self.playing.is_some()
            || self.saving.is_some()
            || self.update.is_some()
        {
            return Err(
                "an identification, a scenario, a save or an update is running: wait for its end".into()
            );
        }
        self.chain.show(session, address)?;
        Ok(self.query_hub()?)
    }

    /// Sends the set-points of a played scenario that are due.
    fn play(&mut self) -> Result<(), Error> {
        let (Some(playing), Some(script), Some(session)) =
            (&mut self.playing, &self.place.script, &mut self.session)
        else {
            return Ok(());
        };
        match or_refusal(script.go_on(playing, session))? {
            Ok(false) => (),
            Ok(true) => self.switch_off("the scenario is over"),
            Err(why) => self.switch_off(&why),
        }
        Ok(())
    }

    /// Disables the motors if the page in control counts as gone.
    fn watch(&mut self) {
        if let Some(gone) = self.pages.review(Instant::now()) {
            self.switch_off_if_any(&gone.to_string());
            self.send_control();
        }
    }

    /// Reads the hub's state into the frame; false if the hub is not connected.
    fn look(&mut self) -> Result<bool, Error> {
        let Some(session) = &mut self.session else { return Ok(false) };
        let number = self.frame.number;
        if let Some(report) = session.report()? {
            if session.resets() != self.resets {
                self.playing = None;
                self.hub_changed_at = Some(Instant::now());
                self.query_hub()?;
                let text =
                    "the hub was reset: its motors are disabled, and settings that were not stored are lost";
                self.send_notice(text.to_owned(), true);
            }
            self.frame = Frame { number, ..Frame::of(&report) };
            return Ok(true);
        }
        let look = self.looked_at.elapsed() > SETPOINT_POLL_INTERVAL;
        let before = std::mem::take(&mut self.frame.motors);
        self.frame = Frame { number, ..Frame::of_other_maker(session, before, look)? };
        if look {
            self.looked_at = Instant::now();
        }
        Ok(true)
    }

    /// Reads the hub's state into the frame, including all orders so far.
    fn look_again(&mut self) -> Result<(), Error> {
        if let Some(session) = &mut self.session {
            session.catch_up()?;
        }
        // If this list is empty, `look` also reads the set-points of another maker's hub.
        self.frame.motors.clear();
        self.look().map(|_| ())
    }

    /// Opens a session. Motors of an earlier session may still run, and a stop in between may have reached no hub, so
    /// all motors are disabled first.
    fn connect(&mut self) {
        self.connect_at = Instant::now() + RECONNECT_INTERVAL;
        match (self.place.open)(self.place.address) {
            Ok(Opened { mut session, hubs }) => {
                session.limit_timeout(REQUEST_TIMEOUT);
                self.chain = Chain::new(&hubs, session.address());
                self.session = Some(session);
                self.hub_changed_at = Some(Instant::now());
                self.switch_off_if_any("the hub is connected again");
                if let Err(error) = self.query_hub() {
                    self.handle_error(&error);
                }
            }
            Err(why) => self.send_line(gone(why)),
        }
    }

    /// Asks the hub of the session what the hub can report and store. Deletes the state that the relay has kept of the
    /// former hub: undo lists, proposals and pin levels. Sends the answers and the settings to the pages.
    fn query_hub(&mut self) -> Result<(), Error> {
        // Pages must know the hub before its first frame.
        if let Some(hubs) = self.chain.changed_hubs() {
            self.send_to_all(&Message::Hubs { hubs });
        }
        let Some(session) = &mut self.session else { return Ok(()) };
        let reports = session.report()?.is_some();
        self.resets = session.resets();
        let stores = session.stored_if_reported()?.is_some();
        let has = session.equipment()?.map(has);
        self.looked_at = Instant::now();
        self.frame.motors.clear();
        (self.executor, self.devices) = Default::default();
        self.settings.clear();
        self.send_line(Message::Line { connected: true, why: String::new(), reports, stores, has });
        self.send_all_settings()
    }

    /// Drops the session after an error. The hub's keep-alive disables its motors 2.5 s after the last packet, or the
    /// next session disables them earlier.
    fn drop_session(&mut self, why: &str) {
        self.session = None;
        (self.identification, self.playing) = (None, None);
        self.connect_at = Instant::now() + RECONNECT_INTERVAL;
        self.lose_save(why);
        // A hub that restarts is silent, so an update that has reached its restart continues.
        if let Some(update) = self.update.take_if(|update| !update.restarts()) {
            self.send_to_all(&Message::Update(update::failed(&update, why)));
        }
        self.send_line(gone(why.to_owned()));
    }

    /// Disables all motors, even if the last frame showed no enabled motor, because an order may have enabled a motor
    /// since that frame. Pages get a notice only if motors were enabled.
    fn switch_off_if_any(&mut self, why: &str) {
        // Neither an identification nor a scenario may enable a motor again.
        (self.identification, self.playing) = (None, None);
        if self.motors_run() {
            self.switch_off(why);
        } else if let Some(session) = &mut self.session {
            self.devices.stopped();
            if let Err(error) = self.chain.stop(session) {
                self.handle_error(&error);
            }
        }
    }

    /// Abandons a running update, so that the hub discards new firmware that it has not started. Disables all motors.
    /// The caller then drops the relay.
    pub fn end(&mut self, why: &str) {
        if let (Some(update), Some(session)) = (self.update.take(), &mut self.session) {
            update.abandon(session);
        }
        self.switch_off(why);
    }

    /// Disables all motors, and sends a notice to all pages.
    fn switch_off(&mut self, why: &str) {
        (self.identification, self.playing) = (None, None);
        let Some(session) = &mut self.session else {
            let text = format!(
                "motors could not be disabled ({why}): the hub is not connected. The hub disables its motors 2.5 s after the last packet, or when it is connected again"
            );
            return self.send_notice(text, true);
        };
        self.devices.stopped();
        match self.chain.stop(session) {
            Ok(()) => {
                self.send_notice(format!("all motors are disabled: {why}"), true);
            }
            Err(error) => {
                let text = format!(
                    "not all motors could be disabled ({why}): {error}. A hub disables its motors 2.5 s after the last packet"
                );
                self.send_notice(text, true);
                self.handle_error(&error);
            }
        }
    }

    /// Continues a running identification.
    fn identify(&mut self) -> Result<(), Error> {
        let (Some(running), Some(session)) = (&mut self.identification, &mut self.session) else {
            return Ok(());
        };
        let motor = running.motor;
        let Some(progress) = running.step(session)? else { return Ok(()) };
        let mut disabled = Ok(());
        if !matches!(progress, Progress::Running { .. }) {
            self.identification = None;
            disabled = session.enable(motor, false);
        }
        if let (Progress::Found { proposal, .. }, Ok(of)) = (&progress, self.executor.of(motor)) {
            of.proposed = Some(*proposal);
        }
        self.send_to_all(&Message::Identification { motor, progress });
        disabled
    }

    /// Reads the state of a running save, load or reset. Sends a notice when the access has ended, or when the hub
    /// refuses to report the state.
    fn follow_save(&mut self) -> Result<(), Error> {
        let (Some((what, access)), Some(session)) = (&self.saving, &mut self.session) else {
            return Ok(());
        };
        let result = or_refusal(access.result(session))?;
        if matches!(result, Ok(None)) {
            return Ok(());
        }
        let (which, verb, done) = access_texts(what);
        let is_save = matches!(what, HubFunction::Save);
        self.saving = None;
        let failure = result.map(|report| report.as_ref().and_then(why_unsaved));
        if !is_save {
            if failure == Ok(None) {
                self.executor.motors = Default::default();
            }
            // A reset that has failed has changed the settings in force, but not the stored settings.
            self.send_all_settings()?;
        }
        let text = match failure {
            Ok(None) => done.to_owned(),
            Ok(Some(why)) => format!("{which} are not {verb}: {why}"),
            Err(why) => format!("whether {which} are {verb} is unknown: {why}"),
        };
        self.send_notice(text, false);
        Ok(())
    }

    /// Ends a running save, load or reset because its hub was lost, and sends a notice.
    fn lose_save(&mut self, why: &str) {
        if let Some((what, _)) = self.saving.take() {
            let (which, verb, _) = access_texts(&what);
            self.send_notice(format!("whether {which} are {verb} is unknown: {why}"), false);
        }
    }

    fn send_settings(&mut self, motor: u8) -> Result<(), Error> {
        let Some(session) = &mut self.session else { return Ok(()) };
        // Another maker's hub refuses to report settings.
        if let Ok(settings) = or_refusal(self.executor.settings(session, motor))? {
            let text = Message::Settings(settings).text();
            if self.settings.insert(motor, text.clone()).as_ref() != Some(&text) {
                self.send(&text);
            }
        }
        Ok(())
    }

    fn send_all_settings(&mut self) -> Result<(), Error> {
        (0..CHANNELS as u8).try_for_each(|motor| self.send_settings(motor))
    }

    fn send_control(&mut self) {
        let (controller, asks) = (self.pages.controller(), self.pages.asks());
        self.send_to_all(&Message::Control { controller, pages: self.pages.count(), asks });
    }

    fn send_line(&mut self, line: Message) {
        self.send_to_all(&line);
        self.line = line;
    }

    /// Sends a message to all pages.
    fn send_to_all(&mut self, message: &Message) {
        self.send(&message.text());
    }

    fn send(&mut self, text: &Arc<str>) {
        self.senders.retain(|_, outbox| outbox.send(text.clone()));
    }

    /// Sends a notice to all pages.
    fn send_notice(&mut self, text: String, motors_disabled: bool) {
        self.send_to_all(&Message::Notice { text, motors_disabled });
    }

    /// Answers the page that has sent an order.
    fn answer(&self, id: u32, answer: &Message) {
        if let Some(outbox) = self.senders.get(&id) {
            outbox.send(answer.text());
        }
    }
}

/// Texts about a save, load or reset: the settings concerned, what is done to them, and the notice after it.
const fn access_texts(what: &HubFunction) -> (&'static str, &'static str, &'static str) {
    match what {
        HubFunction::Load => ("the stored settings", "loaded", "the stored settings are in force"),
        HubFunction::Reset => {
            ("the stored settings", "reset", "the firmware's settings are in force and stored")
        }
        _ => ("settings", "saved", "settings are saved"),
    }
}

/// Answer to a page whose order is executed.
const fn notice(text: String) -> Message {
    Message::Notice { text, motors_disabled: false }
}

/// Message about a hub that does not answer.
const fn gone(why: String) -> Message {
    Message::Line { connected: false, why, reports: true, stores: false, has: None }
}
