//! From what the sensors say to one second: gyro bytes → frames → increments → rate; accelerometers → tilt; encoder → index angle; and the gates, which
//! tell whether a second is good.

pub mod frame;
pub mod gates;
pub mod index;
pub mod level;
pub mod ripple;
pub mod sample;
