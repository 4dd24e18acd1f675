"""The node with its parameters: ``ros2 launch roomsight_ros roomsight.launch.py model:=/models/home/1 image:=/camera/image_raw``."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("roomsight_ros")) / "config" / "roomsight.yaml"
    arguments = {
        "namespace": ("", "The namespace of the node: one for each camera"),
        "image": ("image", "The topic of the pictures, as image_transport names it: without /compressed"),
        "model": ("", "The folder of a model, to recognize in this process"),
        "url": ("", "The address of a service, to recognize there"),
        "transport": ("compressed", "compressed or raw"),
        "laser": ("false", "Whether to take the scans of the laser"),
        "scan": ("scan", "The topic of the scans"),
        "odometry": ("false", "Whether to take how far the robot went"),
        "odom": ("odom", "The topic of the odometry"),
        "params_file": (str(config), "The other parameters"),
    }
    value = LaunchConfiguration
    node = Node(
        package="roomsight_ros",
        executable="room",
        name="roomsight",
        namespace=value("namespace"),
        parameters=[
            value("params_file"),
            {name: value(name) for name in ("model", "url", "transport")},
            {name: ParameterValue(value(name), value_type=bool) for name in ("laser", "odometry")},
        ],
        remappings=[("image", value("image")), ("image/compressed", [value("image"), "/compressed"]), ("scan", value("scan")), ("odom", value("odom"))],
        respawn=True,
        respawn_delay=2.0,
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in arguments.items()
    ]
    return LaunchDescription([*declared, node])
