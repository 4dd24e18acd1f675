from setuptools import setup

NAME = "roomsight_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/roomsight.launch.py"]),
        (f"share/{NAME}/config", ["config/roomsight.yaml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The authors of roomsight",
    maintainer_email="maintainers@roomsight.example",
    description="Tells a robot which room it is in: subscribes pictures, publishes rooms",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"room = {NAME}.node:main"]},
)
