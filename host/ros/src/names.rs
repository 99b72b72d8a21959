//! Names on the wire of rmw_zenoh: keys of data, liveliness tokens, and the attachment of each message.

use crate::config::Distribution;
use crate::messages::{Stamp, Type};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use xxhash_rust::xxh3::xxh3_128;

/// Kind of an entity of a ROS node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Publisher,
    Subscriber,
    Service,
}

impl Kind {
    const fn name(self) -> &'static str {
        match self {
            Self::Publisher => "MP",
            Self::Subscriber => "MS",
            Self::Service => "SS",
        }
    }
}

/// A topic or service of a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entity<'a> {
    pub(crate) kind: Kind,
    /// Absolute name, such as `/hub0/cmd_vel`.
    pub(crate) name: &'a str,
    pub(crate) of: Type,
    /// True if a subscriber that joins late receives the last message.
    pub(crate) latched: bool,
}

/// A node in the graph of ROS.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) domain: u32,
    pub(crate) distribution: Distribution,
    /// Id of the Zenoh session in hexadecimal.
    pub(crate) session: String,
    /// Number of the node, unique among all nodes and entities of the session.
    pub(crate) number: usize,
    /// Absolute namespace such as `/hub0`; empty for none.
    pub(crate) namespace: String,
    pub(crate) name: &'static str,
}

impl Node {
    /// Returns the Zenoh key of the messages of a topic or service.
    pub(crate) fn key(&self, entity: &Entity<'_>) -> String {
        let name = entity.name.trim_matches('/');
        format!("{}/{name}/{}/{}", self.domain, entity.of.dds, self.hash(entity.of))
    }

    /// Returns the liveliness token that makes the node visible to ROS.
    pub(crate) fn token(&self) -> String {
        self.token_of("NN", self.number)
    }

    /// Returns the key expression that matches the tokens of all publishers of a topic, with any type.
    pub(crate) fn publishers(&self, topic: &str) -> String {
        format!("@ros2_lv/{}/*/*/*/MP/*/*/*/{}/**", self.domain, mangled(topic))
    }

    /// Returns the liveliness token that makes a topic or service visible to ROS. `number` is unique among all nodes
    /// and entities of the session.
    pub(crate) fn entity_token(&self, entity: &Entity<'_>, number: usize) -> String {
        let qos = if entity.latched { ":1:,1:,:,:,," } else { "::,10:,:,:,," };
        let (head, name) = (self.token_of(entity.kind.name(), number), mangled(entity.name));
        format!("{head}/{name}/{}/{}/{qos}", entity.of.dds, self.hash(entity.of))
    }

    fn token_of(&self, kind: &str, number: usize) -> String {
        let Self { domain, session, number: node, name, .. } = self;
        format!("@ros2_lv/{domain}/{session}/{node}/{number}/{kind}/%/{}/{name}", mangled(&self.namespace))
    }

    /// Returns the hash of a type for keys and tokens. Humble uses one constant text instead of hashes.
    const fn hash(&self, of: Type) -> &'static str {
        match self.distribution {
            Distribution::Humble => "TypeHashNotSupported",
            Distribution::Jazzy | Distribution::Kilted | Distribution::Lyrical => of.hash,
        }
    }
}

/// Returns a name as tokens spell it: `/` becomes `%`, and an empty name becomes `%`.
fn mangled(name: &str) -> String {
    if name.is_empty() { "%".to_owned() } else { name.replace('/', "%") }
}

/// Identifies a publisher, or a client of a service.
pub(crate) type Gid = [u8; 16];

/// Returns the GID of the entity with this token.
pub(crate) fn gid(token: &str) -> Gid {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

/// Source of a message.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    pub(crate) gid: Gid,
    /// Id of the session that added Zenoh's time stamp to the message: the publisher's session, or the router if the
    /// publisher adds no time stamp.
    pub(crate) timed_by: Option<String>,
}

/// Session and node of a publisher, as its token spells them.
#[derive(Clone, Debug)]
struct Owner {
    session: String,
    node: String,
}

/// Publishers that are visible at present, by GID. All hubs share this table.
#[derive(Clone, Debug, Default)]
pub(crate) struct Publishers(Arc<Mutex<BTreeMap<Gid, Owner>>>);

impl Publishers {
    /// Adds the publisher of a token if `is_alive` is true, otherwise removes the publisher. A token of another form is
    /// ignored.
    pub(crate) fn note(&self, token: &str, is_alive: bool) {
        let parts: Vec<&str> = token.split('/').collect();
        let [_, _, session, _, _, "MP", _, namespace, node, ..] = parts[..] else { return };
        if is_alive {
            let node = format!("{}/{node}", namespace.trim_end_matches('%').replace('%', "/"));
            self.lock().insert(gid(token), Owner { session: session.to_owned(), node });
        } else {
            self.lock().remove(&gid(token));
        }
    }

    /// Returns true if both messages come from one session, which is one process. If a publisher is not visible, only
    /// equal GIDs count.
    pub(crate) fn is_same(&self, a: &Source, b: &Source) -> bool {
        let sessions = [a, b].map(|source| self.owner(source).map(|owner| owner.session));
        a.gid == b.gid || matches!(sessions, [Some(a), Some(b)] if a == b)
    }

    /// Returns the name of a source for users: its node and the first digits of its session's id. Without a visible
    /// publisher the name is the first digits of its GID.
    pub(crate) fn name(&self, source: &Source) -> String {
        match self.owner(source) {
            Some(Owner { session, node }) => {
                format!("{node} (session {})", session.get(..8).unwrap_or(&session))
            }
            None => source.gid.iter().take(4).map(|byte| format!("{byte:02x}")).collect(),
        }
    }

    /// Returns session and node of a source. Some peers have GIDs that are not the hash of their token. Such a peer is
    /// found by the session that added the time stamp.
    fn owner(&self, source: &Source) -> Option<Owner> {
        let owners = self.lock();
        let by_time = || owners.values().find(|owner| Some(&owner.session) == source.timed_by.as_ref());
        owners.get(&source.gid).or_else(by_time).cloned()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Gid, Owner>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The attachment of a message. A ROS process aborts if it receives an attachment of another length or layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Attachment {
    /// Number of the message. Each publisher or client counts its messages from 1.
    pub(crate) sequence: i64,
    pub(crate) at: Stamp,
    pub(crate) gid: Gid,
}

impl Attachment {
    /// Length of an attachment in bytes.
    pub(crate) const LENGTH: usize = 33;
    /// Length of the GID in bytes. This byte precedes the GID.
    const GID_LENGTH: u8 = 16;

    pub(crate) fn to_bytes(self) -> Vec<u8> {
        let numbers = [self.sequence.to_le_bytes(), self.at.0.to_le_bytes()].concat();
        [&numbers[..], &[Self::GID_LENGTH], &self.gid].concat()
    }

    /// Reads an attachment; `None` for bytes of another length or layout.
    pub(crate) fn read(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::LENGTH] = bytes.try_into().ok()?;
        let number = |from: usize| Some(i64::from_le_bytes(bytes.get(from..from + 8)?.try_into().ok()?));
        let gid = bytes.get(17..)?.try_into().ok()?;
        (bytes[16] == Self::GID_LENGTH).then_some(Self { sequence: number(0)?, at: Stamp(number(8)?), gid })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{JOINT_STATE, TRIGGER};

    fn node(distribution: Distribution) -> Node {
        Node {
            domain: 0,
            distribution,
            session: "aac3178e146ba6f1fc6e6a4085e77f21".to_owned(),
            number: 0,
            namespace: "/hub0".to_owned(),
            name: "motor_hub",
        }
    }

    const STATES: Entity<'static> =
        Entity { kind: Kind::Publisher, name: "/hub0/joint_states", of: JOINT_STATE, latched: false };

    /// A token of rmw_zenoh's documentation, and its XXH3-128 by an independent implementation.
    const TOKEN: &str = "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/1/MP/%/%hub0/motor_hub/%hub0%joint_states/\
        sensor_msgs::msg::dds_::JointState_/RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e/::,10:,:,:,,";
    const GID: Gid =
        [0x85, 0x1b, 0xd7, 0x10, 0xcb, 0x2f, 0xe7, 0x42, 0x94, 0x0f, 0x4f, 0xb2, 0x8a, 0x33, 0xd8, 0xc1];

    #[test]
    fn keys_and_tokens_are_those_of_rmw_zenoh() {
        let node = node(Distribution::Jazzy);
        assert_eq!(node.entity_token(&STATES, 1), TOKEN);
        assert_eq!(gid(TOKEN), GID);
        assert_eq!(node.token(), "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%hub0/motor_hub");
        let stop = Entity { kind: Kind::Service, name: "/hub0/stop", of: TRIGGER, latched: false };
        assert_eq!(node.key(&stop), format!("0/hub0/stop/std_srvs::srv::dds_::Trigger_/{}", TRIGGER.hash));
        let at_root = Node { namespace: String::new(), ..node };
        assert_eq!(at_root.token(), "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/motor_hub");
    }

    #[test]
    fn two_topics_of_one_process_have_one_source() {
        let publishers = Publishers::default();
        let token = |session: &str, number: u8, node: &str| {
            format!(
                "@ros2_lv/0/{session}/0/{number}/MP/%/%/{node}/%hub0%cmd_vel/geometry_msgs::msg::dds_::Twist_/X/::,10:,:,:,,"
            )
        };
        let tokens =
            [token("aac3178e14", 1, "teleop"), token("aac3178e14", 2, "teleop"), token("bb", 1, "planner")];
        let [first, second, other] =
            tokens.each_ref().map(|token| Source { gid: gid(token), timed_by: None });
        assert!(!publishers.is_same(&first, &second));
        tokens.iter().for_each(|token| publishers.note(token, true));
        assert!(publishers.is_same(&first, &second) && !publishers.is_same(&first, &other));
        // A peer whose GID is not the hash of its token is found by its time stamp. A time stamp of the router
        // identifies no peer.
        let timed = |session: &str| Source { gid: [9; 16], timed_by: Some(session.to_owned()) };
        assert!(publishers.is_same(&timed("bb"), &other) && !publishers.is_same(&timed("cc"), &other));
        assert_eq!(publishers.name(&first), "/teleop (session aac3178e)");
        publishers.note(&tokens[2], false);
        assert_eq!(publishers.name(&timed("bb")), "09090909");
    }

    #[test]
    fn an_attachment_has_33_bytes_and_is_read_back() {
        let attachment = Attachment { sequence: 7, at: Stamp(1_000_000_002), gid: GID };
        let bytes = attachment.to_bytes();
        assert_eq!((bytes.len(), bytes[0], bytes[8], bytes[16]), (33, 7, 2, 16));
        assert_eq!(Attachment::read(&bytes), Some(attachment));
    }

    #[test]
    fn an_attachment_of_another_length_or_layout_is_refused() {
        let bytes = Attachment { sequence: 7, at: Stamp(0), gid: GID }.to_bytes();
        assert!((0..33).all(|end| Attachment::read(&bytes[..end]).is_none()));
        assert_eq!(Attachment::read(&[&bytes[..], &[0]].concat()), None);
        let mut other = bytes;
        other[16] = 15;
        assert_eq!(Attachment::read(&other), None);
    }
}
