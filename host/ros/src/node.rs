//! One hub as a node of ROS 2: its topics and services on a Zenoh session.

use crate::config::{Distribution, Hub};
use crate::messages::{self, JointCommands, Stamp, Type};
use crate::names::{Attachment, Entity, Gid, Kind, Node, Publishers, Source, gid};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::{Query, Queryable};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

/// Interval at which a latched publisher announces the number of its last message.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Event for the thread of a hub.
pub(crate) enum Event {
    /// Forward speed in m/s and turning speed in rad/s.
    Twist(Source, (f64, f64)),
    Joints(Source, JointCommands),
    Call(Call, Answer),
}

/// An event, and the time of its arrival.
pub(crate) type Arrived = (Instant, Event);

/// A call of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Call {
    Stop,
    Enable(bool),
    ResetEncoders,
    Identify,
    SaveSettings,
}

/// A call that waits for its answer. A client that gets no answer waits for minutes, so a call whose answer is dropped
/// fails.
pub(crate) struct Answer {
    query: Query,
    request: Attachment,
    outcome: Result<String, String>,
}

impl Answer {
    fn new(query: Query, request: Attachment) -> Self {
        Self { query, request, outcome: Err("the hub was lost".to_owned()) }
    }

    /// Answers the call.
    pub(crate) fn send(mut self, outcome: Result<String, String>) {
        self.outcome = outcome;
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        let (success, message) = match &self.outcome {
            Ok(message) => (true, message),
            Err(message) => (false, message),
        };
        let attachment = Attachment { at: now(), ..self.request };
        let reply = self.query.reply(self.query.key_expr().clone(), messages::answer(success, message));
        if let Err(error) = reply.attachment(attachment.to_bytes()).wait() {
            print_error_line!("warning: a call could not be answered: {error}");
        }
    }
}

/// Returns the time of the wall clock.
pub(crate) fn now() -> Stamp {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}

enum Channel {
    Volatile(zenoh::pubsub::Publisher<'static>),
    Latched(AdvancedPublisher<'static>),
}

/// A publisher, which is visible to ROS until it is dropped.
pub(crate) struct Publisher {
    channel: Channel,
    gid: Gid,
    sequence: i64,
    _token: LivelinessToken,
}

impl Publisher {
    /// Publishes a message.
    pub(crate) fn put(&mut self, message: Vec<u8>, at: Stamp) -> zenoh::Result<()> {
        self.sequence += 1;
        let attachment = Attachment { sequence: self.sequence, at, gid: self.gid }.to_bytes();
        match &self.channel {
            Channel::Volatile(publisher) => publisher.put(message).attachment(attachment).wait(),
            Channel::Latched(publisher) => publisher.put(message).attachment(attachment).wait(),
        }
    }
}

/// Topics that a hub publishes.
pub(crate) struct Topics {
    pub(crate) joint_states: Publisher,
    /// Odometry and its transform; `None` without a drive base.
    pub(crate) odometry: Option<(Publisher, Publisher)>,
    /// Heading by the gyro; `None` without a drive base that uses one.
    pub(crate) imu: Option<Publisher>,
    pub(crate) battery_state: Publisher,
    pub(crate) diagnostics: Publisher,
    _description: Option<Publisher>,
    /// Subscribers of commands. These and the following fields are active and visible to ROS until they are dropped.
    _subscribers: Vec<(Subscriber<()>, LivelinessToken)>,
    _publishers: Vec<Subscriber<()>>,
    _services: Vec<(Queryable<()>, LivelinessToken)>,
    _node: LivelinessToken,
}

/// Declares nodes and their entities. Each node and each entity has its own number in the session.
pub(crate) struct Graph<'a> {
    session: &'a Session,
    domain: u32,
    distribution: Distribution,
    /// Visible publishers of commands to all hubs. The hubs share this table.
    publishers: Publishers,
    numbers: std::ops::RangeFrom<usize>,
}

impl<'a> Graph<'a> {
    pub(crate) fn new(session: &'a Session, domain: u32, distribution: Distribution) -> Self {
        Self { session, domain, distribution, publishers: Publishers::default(), numbers: 0.. }
    }

    pub(crate) fn publishers(&self) -> Publishers {
        self.publishers.clone()
    }

    /// Declares a hub's node. Commands and calls are sent to `events`. Malformed messages are dropped and counted.
    pub(crate) fn join(
        &mut self,
        hub: &Hub,
        description: Option<&str>,
        events: &Sender<Arrived>,
        malformed: &Arc<AtomicU64>,
    ) -> zenoh::Result<Topics> {
        let node = Node {
            domain: self.domain,
            distribution: self.distribution,
            session: self.session.zid().to_string(),
            number: self.number(),
            namespace: hub.namespace.clone(),
            name: "motor_hub",
        };
        let visible = self.token(&node.token())?;
        let name = |topic: &str| format!("{}/{topic}", hub.namespace);

        let commands: [(&str, Type, Reader); 3] = [
            ("cmd_vel", messages::TWIST, |from, message| {
                Some(Event::Twist(from, messages::read_twist(message)?))
            }),
            ("cmd_vel", messages::TWIST_STAMPED, |from, message| {
                Some(Event::Twist(from, messages::read_twist_stamped(message)?))
            }),
            ("joint_commands", messages::JOINT_STATE, |from, message| {
                Some(Event::Joints(from, messages::read_joint_commands(message)?))
            }),
        ];
        // The tokens of publishers are watched before the commands are subscribed, so that a command's publisher is
        // usually known when the command arrives.
        let publishers = ["cmd_vel", "joint_commands"]
            .map(|topic| self.watch(&node.publishers(&name(topic))))
            .into_iter()
            .collect::<Result<_, _>>()?;
        let mut subscribers = Vec::new();
        for (topic, of, read) in commands {
            if topic != "cmd_vel" || hub.base.is_some() {
                subscribers.push(self.subscriber(&node, &name(topic), of, read, events, malformed)?);
            }
        }
        let set_bool = |request: &[u8]| messages::read_set_bool(request).map(Call::Enable);
        let mut services =
            vec![self.service(&node, &name("enable"), messages::SET_BOOL, set_bool, events, malformed)?];
        for (service, call) in [
            ("stop", Call::Stop),
            ("reset_encoders", Call::ResetEncoders),
            ("identify", Call::Identify),
            ("save_settings", Call::SaveSettings),
        ] {
            let trigger = move |request: &[u8]| messages::read_trigger(request).map(|()| call);
            services.push(self.service(
                &node,
                &name(service),
                messages::TRIGGER,
                trigger,
                events,
                malformed,
            )?);
        }
        let odometry = match hub.base {
            // In ROS all robots share one topic for transforms and one for diagnostics.
            Some(_) => Some((
                self.publisher(&node, &name("odom"), messages::ODOMETRY)?,
                self.publisher(&node, "/tf", messages::TF)?,
            )),
            None => None,
        };
        let description = match description {
            Some(text) => Some(self.latched(&node, &name("robot_description"), messages::STRING, text)?),
            None => None,
        };
        Ok(Topics {
            joint_states: self.publisher(&node, &name("joint_states"), messages::JOINT_STATE)?,
            odometry,
            imu: match hub.base.as_ref().filter(|base| base.use_gyro) {
                Some(_) => Some(self.publisher(&node, &name("imu"), messages::IMU)?),
                None => None,
            },
            battery_state: self.publisher(&node, &name("battery_state"), messages::BATTERY_STATE)?,
            diagnostics: self.publisher(&node, "/diagnostics", messages::DIAGNOSTICS)?,
            _description: description,
            _subscribers: subscribers,
            _publishers: publishers,
            _services: services,
            _node: visible,
        })
    }

    fn number(&mut self) -> usize {
        self.numbers.next().unwrap_or_default()
    }

    fn token(&self, token: &str) -> zenoh::Result<LivelinessToken> {
        self.session.liveliness().declare_token(token.to_owned()).wait()
    }

    /// Declares the token of an entity. The entity itself must be declared before, because a peer uses the entity as
    /// soon as it receives the token.
    fn visible(&mut self, node: &Node, entity: &Entity<'_>) -> zenoh::Result<(LivelinessToken, Gid)> {
        let token = node.entity_token(entity, self.number());
        Ok((self.token(&token)?, gid(&token)))
    }

    fn publisher(&mut self, node: &Node, name: &str, of: Type) -> zenoh::Result<Publisher> {
        let entity = Entity { kind: Kind::Publisher, name, of, latched: false };
        let channel = Channel::Volatile(self.session.declare_publisher(node.key(&entity)).wait()?);
        let (token, gid) = self.visible(node, &entity)?;
        Ok(Publisher { channel, gid, sequence: 0, _token: token })
    }

    /// Declares a latched publisher, and publishes `text`. Subscribers that join later receive this message too.
    fn latched(&mut self, node: &Node, name: &str, of: Type, text: &str) -> zenoh::Result<Publisher> {
        let entity = Entity { kind: Kind::Publisher, name, of, latched: true };
        let publisher = self
            .session
            .declare_publisher(node.key(&entity))
            .cache(CacheConfig::default().max_samples(1))
            .publisher_detection()
            .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT))
            .wait()?;
        let (token, gid) = self.visible(node, &entity)?;
        let mut publisher =
            Publisher { channel: Channel::Latched(publisher), gid, sequence: 0, _token: token };
        publisher.put(messages::string(text), now())?;
        Ok(publisher)
    }

    /// Subscribes the liveliness tokens that match `tokens`, and records their publishers.
    fn watch(&self, tokens: &str) -> zenoh::Result<Subscriber<()>> {
        let publishers = self.publishers();
        let liveliness = self.session.liveliness();
        let watched = liveliness.declare_subscriber(tokens.to_owned()).history(true);
        watched
            .callback(move |sample| {
                publishers.note(sample.key_expr().as_str(), sample.kind() == SampleKind::Put)
            })
            .wait()
    }

    fn subscriber(
        &mut self,
        node: &Node,
        name: &str,
        of: Type,
        read: Reader,
        events: &Sender<Arrived>,
        malformed: &Arc<AtomicU64>,
    ) -> zenoh::Result<(Subscriber<()>, LivelinessToken)> {
        let entity = Entity { kind: Kind::Subscriber, name, of, latched: false };
        let (events, malformed) = (events.clone(), malformed.clone());
        let subscriber = self
            .session
            .declare_subscriber(node.key(&entity))
            .callback(move |sample| {
                let attachment = sample.attachment().and_then(|bytes| Attachment::read(&bytes.to_bytes()));
                let timed_by = sample.timestamp().map(|time| time.get_id().to_string());
                let source = attachment.map(|Attachment { gid, .. }| Source { gid, timed_by });
                match source.and_then(|source| read(source, &sample.payload().to_bytes())) {
                    // Sending fails only after the hub's thread has ended, at the end of the program.
                    Some(event) => drop(events.send((Instant::now(), event))),
                    None => drop(malformed.fetch_add(1, Ordering::Relaxed)),
                }
            })
            .wait()?;
        Ok((subscriber, self.visible(node, &entity)?.0))
    }

    fn service(
        &mut self,
        node: &Node,
        name: &str,
        of: Type,
        read: impl Fn(&[u8]) -> Option<Call> + Send + Sync + 'static,
        events: &Sender<Arrived>,
        malformed: &Arc<AtomicU64>,
    ) -> zenoh::Result<(Queryable<()>, LivelinessToken)> {
        let entity = Entity { kind: Kind::Service, name, of, latched: false };
        let (events, malformed) = (events.clone(), malformed.clone());
        let queryable = self
            .session
            .declare_queryable(node.key(&entity))
            // Clients of rmw_zenoh send requests to complete queryables only.
            .complete(true)
            .callback(move |query| {
                let request = query.attachment().and_then(|bytes| Attachment::read(&bytes.to_bytes()));
                let call = query.payload().and_then(|payload| read(&payload.to_bytes()));
                match (request, call) {
                    (Some(request), Some(call)) => {
                        let _ = events.send((Instant::now(), Event::Call(call, Answer::new(query, request))));
                    }
                    _ => drop(malformed.fetch_add(1, Ordering::Relaxed)),
                }
            })
            .wait()?;
        Ok((queryable, self.visible(node, &entity)?.0))
    }
}

/// Reads a message with a command.
type Reader = fn(Source, &[u8]) -> Option<Event>;
