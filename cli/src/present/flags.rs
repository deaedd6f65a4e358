//! What each doubt about an azimuth means, for people.

use north_finder::health::Flag;

/// One sentence on a flag.
pub fn explain(flag: Flag) -> &'static str {
    match flag {
        Flag::Uncalibrated => "no error model from a calibration is stored",
        Flag::Disturbed => "the disturbance gate had to wait for the base to come to rest",
        Flag::Jitter => "the jitter gate had to wait after a move",
        Flag::Knocked => "seconds were left out because the rate jumped in them",
        Flag::FramesLost => "seconds were repaired or left out because gyro frames were lost",
        Flag::BaseMotion => "the base turned while measuring; what the accelerometers saw of it was taken out",
        Flag::Drift => "the bias drifted more than declared; the drift was estimated",
        Flag::Misfit => "the rates do not fit the Earth's rotation within their noise",
        Flag::Amplitude => {
            "the horizontal rate is not the Earth's at this latitude: latitude, scale factor or a disturbance"
        }
        Flag::TiltUnknown => "the tilt was not measured and is taken as zero",
        Flag::Noisy => "the scatter is well above the declared noise",
        Flag::Temperature => "the temperature changed while measuring, and no error model covers that",
        Flag::NoRedundancy => "the positions leave no redundancy: nothing would show an error",
        Flag::Wandering => "the rate wanders inside the stays instead of scattering",
    }
}
