//! Triads on their own: gyros on a three-axis table and on a ship, accelerometers placed by hand.
//!
//! For calibrations. As in the rest of the simulator everything follows from attitudes in three dimensions: a sensor has a
//! direction in the case, the case has an attitude, and the sensor reads the component of what there is.

mod accelerometers;
pub mod drawn;
mod gyros;
mod hand;
mod ship;
mod table;

pub use accelerometers::AccelerometerTriad;
pub use gyros::{GyroTriad, TriadErrors};
pub use hand::{HandReading, Placement, even_directions, place_by_hand};
pub use ship::{ShipStep, ShipVoyage, distance_nmi};
pub use table::{PositionOfTable, SIX_POSITIONS, Shock, Spin, Table, TableRow, Visit, Warming};
