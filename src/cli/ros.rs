//! `roomsight ros`: pictures of the topics of ROS 2 in, rooms out.

mod camera;
mod diagnostics;
mod latest;
mod recent;
mod senses;

use super::answering::AnsweringArgs;
use super::manners::note;
use anyhow::bail;
use camera::{Camera, CameraTopic};
use clap::builder::FalseyValueParser;
use clap::{Args, ValueEnum};
use diagnostics::Diagnostics;
use roomsight_recognition::filter::Trust;
use roomsight_ros::{DdsOptions, NodeName, Options, Remap, Session, Transport, ZenohOptions};
use senses::Senses;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;

/// The most that ROS takes as `ROS_DOMAIN_ID`.
const MAX_DOMAIN: u16 = 232;

/// Distributions whose identifiers of nodes are long.
const WITH_LONG_IDS: [&str; 4] = ["foxy", "galactic", "humble", "eloquent"];

/// Tell the room to ROS 2
///
/// Subscribes the pictures of cameras and publishes rooms as roomsight_msgs/msg/RoomAnswer, over DDS or zenoh, without ROS: nothing of it
/// has to be installed. While a picture is looked at, of those that come only the latest waits. What ROS 2 reads of the environment is
/// read too: ROS_DOMAIN_ID, RMW_IMPLEMENTATION, ROS_LOCALHOST_ONLY, ZENOH_SESSION_CONFIG_URI.
#[derive(Args)]
pub(super) struct RosArgs {
    /// The topic of a camera's pictures. Of several each has a name, as in front=/front/image_raw: answers go to ~/front/answer
    #[arg(long = "image", value_name = "[NAME=]TOPIC", default_value = "image")]
    images: Vec<CameraTopic>,
    /// How pictures are published: TOPIC/compressed as sensor_msgs/msg/CompressedImage, or TOPIC as sensor_msgs/msg/Image
    #[arg(long, value_name = "HOW", default_value = "compressed")]
    transport: ImageTransport,
    #[command(flatten)]
    answering: AnsweringArgs,
    /// What the service calls the robot [default: as the node]
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// How much one picture counts, above 0 to 10
    #[arg(long, value_parser = trust)]
    trust: Option<Trust>,
    /// Look at most at so many pictures a second of each camera
    #[arg(long, value_name = "RATE", value_parser = super::stream::rate)]
    fps: Option<f64>,
    /// Subscribe the scans of the laser, on the topic scan, for models that were trained with --laser
    #[arg(long)]
    laser: bool,
    /// Subscribe the odometry, on the topic odom: a robot that stands is then believed to stay
    #[arg(long)]
    odometry: bool,
    /// The way that messages travel
    #[arg(long, value_name = "WAY", default_value = "dds", env = "RMW_IMPLEMENTATION")]
    over: Over,
    /// Only nodes of the same domain hear each other
    #[arg(long, value_name = "N", default_value_t = 0, env = "ROS_DOMAIN_ID", value_parser = domain)]
    domain: u16,
    /// The namespace of the node
    #[arg(long, value_name = "NAMESPACE", default_value = "/")]
    namespace: String,
    /// The name of the node
    #[arg(long, value_name = "NAME", default_value = "roomsight")]
    name: String,
    /// Another name for a topic
    #[arg(short, long = "remap", value_name = "FROM:=TO")]
    remaps: Vec<Remap>,
    /// Over DDS: nodes on this machine alone
    #[arg(long, env = "ROS_LOCALHOST_ONLY", value_parser = FalseyValueParser::new())]
    localhost: bool,
    /// Over zenoh: the router, as rmw_zenohd is
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/localhost:7447")]
    router: String,
    /// Over zenoh: a file of zenoh's settings instead
    #[arg(long, value_name = "FILE", env = "ZENOH_SESSION_CONFIG_URI", conflicts_with = "router")]
    zenoh_config: Option<PathBuf>,
    /// The distribution of ROS around: up to humble, nodes are told otherwise
    #[arg(long, value_name = "NAME", default_value = "jazzy", env = "ROS_DISTRO")]
    distribution: String,
    /// Print a line for every picture, as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ImageTransport {
    /// As the camera, or its driver, encoded them
    Compressed,
    /// Pixels
    Raw,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Over {
    /// As with rmw_fastrtps_cpp and rmw_cyclonedds_cpp
    // A variable of the environment that is empty counts as none, for ROS too.
    #[value(aliases = ["", "rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp", "rmw_cyclonedds_cpp", "rmw_connextdds"])]
    Dds,
    /// As with rmw_zenoh_cpp
    #[value(alias = "rmw_zenoh_cpp")]
    Zenoh,
}

/// As ROS reads it: nothing is 0.
fn domain(text: &str) -> Result<u16, String> {
    let domain = if text.is_empty() { Some(0) } else { text.parse().ok() };
    let domain = domain.filter(|domain| *domain <= MAX_DOMAIN);
    domain.ok_or_else(|| format!("it must be from 0 to {MAX_DOMAIN}"))
}

fn trust(text: &str) -> Result<Trust, String> {
    let trust: f32 = text.parse().map_err(|_| "it is no number".to_owned())?;
    Trust::try_from(trust).map_err(|error| error.to_string())
}

/// A node with what it was asked to rename.
struct Node {
    session: Session,
    name: NodeName,
    remaps: Vec<Remap>,
}

impl Node {
    fn topic(&self, name: &str) -> anyhow::Result<String> {
        Ok(self.name.remapped(name, &self.remaps)?)
    }
}

/// Answers until Ctrl-C, or until a service is out of reach for too long.
pub(super) fn run(args: &RosArgs) -> anyhow::Result<()> {
    if args.images.len() > 1 && args.images.iter().any(|camera| camera.name.is_none()) {
        bail!("of several cameras each has a name: --image front=/front/image_raw");
    }
    let answerer = args.answering.answerer()?;
    if answerer.wants_scans() && !args.laser {
        note!("note: the model looks at the scans of a laser too: --laser lets it");
    }
    tokio::runtime::Runtime::new()?.block_on(async {
        let options = args.options()?;
        let session = Session::open(&options).await?;
        let node = Node { session, name: options.node, remaps: args.remaps.clone() };
        let senses = Arc::new(Senses::subscribe(&node, args.laser, args.odometry).await?);
        let (mut cameras, mut working) = (Vec::new(), JoinSet::new());
        for topic in &args.images {
            let robot = args.robot.as_deref().unwrap_or(&args.name);
            let robot = topic.name.as_ref().map_or(robot.to_owned(), |name| format!("{robot}-{name}"));
            let answering = answerer.for_camera(&robot, args.trust).await?;
            let camera = Camera::open(&node, topic, args).await?;
            cameras.push(camera.watched());
            working.spawn(camera.work(answering, Arc::clone(&senses)));
        }
        let diagnostics = Diagnostics::open(&node, cameras).await?;
        tokio::select! {
            Some(ended) = working.join_next() => ended?,
            never = diagnostics.work() => match never {},
            _ = tokio::signal::ctrl_c() => Ok(()),
        }
    })
}

impl RosArgs {
    fn options(&self) -> anyhow::Result<Options> {
        let transport = match self.over {
            Over::Dds => Transport::Dds(DdsOptions {
                localhost: self.localhost,
                has_long_ids: WITH_LONG_IDS.contains(&self.distribution.as_str()),
            }),
            Over::Zenoh => Transport::Zenoh(ZenohOptions {
                config: self.zenoh_config.clone(),
                router: self.router.clone(),
            }),
        };
        let node = NodeName::new(&self.namespace, &self.name)?;
        Ok(Options { node, domain: self.domain, transport })
    }

    /// The least time between two pictures that are looked at.
    fn gap(&self) -> Duration {
        self.fps.map_or(Duration::ZERO, |fps| Duration::from_secs_f64(1.0 / fps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ros_reads_of_the_environment_is_read_as_ros_does() {
        assert_eq!(["", "0", "232"].map(domain), [Ok(0), Ok(0), Ok(232)]);
        assert!(["233", "-1", "x", "99999"].into_iter().all(|text| domain(text).is_err()));
        let over = |text| Over::from_str(text, false).ok();
        assert_eq!(["", "rmw_fastrtps_cpp", "dds"].map(over), [Some(Over::Dds); 3]);
        assert_eq!(
            ["rmw_zenoh_cpp", "zenoh", "rmw_other"].map(over),
            [Some(Over::Zenoh), Some(Over::Zenoh), None]
        );
    }
}
