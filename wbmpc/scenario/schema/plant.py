"""What happens to the robot without the controller being told: disturbances, a plant that differs, sensor noise."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from wbmpc.strict import Friction, NonNegative, Positive, StrictModel, Vector3

MassScale = Annotated[float, Field(gt=0, le=10)]
GroundError = Annotated[float, Field(ge=0, le=0.05)]


class Impulse(StrictModel):
    """A push: a constant force over a short time."""

    kind: Literal["impulse"] = Field(description="A push on one body.")
    body: str = Field(min_length=1, description="Name of the robot's body that is pushed.")
    time: NonNegative = Field(description="When the push begins [s].")
    duration: Positive = Field(default=0.1, description="How long it lasts [s].")
    impulse: Vector3 = Field(description="Force times duration, in world [N·s].")
    point: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Where it acts, in the body's frame [m].")

    @property
    def end(self) -> float:
        """When the push is over [s]."""
        return self.time + self.duration


# One kind only for now: a second one makes this `Annotated[Impulse | Other, Field(discriminator="kind")]`.
Disturbance = Impulse


class PlantSettings(StrictModel):
    """How the simulated robot and world differ from what the controller believes."""

    mass_scale: MassScale = Field(default=1.0, description="Factor on mass and inertia of all the robot's bodies [-].")
    body_mass_scale: dict[str, MassScale] = Field(
        default={},
        description="Further factors on mass and inertia, by name of a body or of an object with a mass [-].",
    )
    friction: Friction | None = Field(
        default=None, description="True friction coefficient of floor and objects [-]; null: as declared in `world`."
    )
    ground_error: GroundError = Field(
        default=0.0,
        description="Walkable objects, treads and tiles are higher or lower by up to so much, uniformly at random [m].",
    )


class SensorSettings(StrictModel):
    """White noise of the sensors, as standard deviations of a servo and IMU of this class, off by default."""

    noise_scale: NonNegative = Field(default=0.0, description="Factor on all standard deviations [-]; 0: no noise.")
    joint_position_noise: NonNegative = Field(default=0.0005, description="12-bit encoders of MX-28 servos [rad].")
    joint_velocity_noise: NonNegative = Field(default=0.02, description="Joint speeds [rad/s].")
    gyro_noise: NonNegative = Field(default=0.005, description="IMU angular velocity, per axis [rad/s].")
    accelerometer_noise: NonNegative = Field(default=0.05, description="IMU specific force, per axis [m/s²].")
    orientation_noise: NonNegative = Field(default=0.001, description="IMU attitude, per axis [rad].")
    force_noise: NonNegative = Field(default=0.1, description="Sole and palm force sensors, per axis [N].")
    moment_noise: NonNegative = Field(default=0.005, description="Sole moment sensors, per axis [N·m].")
