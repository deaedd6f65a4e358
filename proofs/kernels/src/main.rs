//! What single steps after a fix cost on the target: a program for QEMU's mps2-an386, run by `north bench cost`.
//!
//! A line each: name, instructions, most stack in bytes, RAM that it keeps in bytes.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[allow(dead_code, unused_imports)] // the firmware uses the rest
#[path = "../../../src/board/mps2/pac.rs"]
mod pac;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This program runs in QEMU: north bench cost");
    std::process::exit(2);
}

#[cfg(target_os = "none")]
mod target {
    use core::hint::black_box;
    use core::mem::size_of;

    use cortex_m_rt::entry;
    use cortex_m_semihosting::{debug, hprintln};
    use inertial::esg::filter::{EsgErrors, PickOff};
    use inertial::esg::reference::DriftCoefficients;
    use inertial::filter::block::BlockErrors;
    use inertial::filter::measurement::Measurement;
    use inertial::filter::navigation::Navigation;
    use inertial::filter::{BlockReading, Filter, Installation, Mode, StartSigmas};
    use inertial::{Increment, Quaternion};
    use nalgebra::Vector3;
    use north_finder::drivers::adis16505::{Increments, Range};
    use north_finder::fix::Fix;
    use north_finder::fix::heading::Keeper;
    use north_finder::fix::heading::settings::BlockSettings;
    use north_finder::health::{Counters, Flags};
    use north_finder::sensing::level::Tilt;

    use crate::pac::TIMER0;

    /// A cycle of the timer is 40 ns, an instruction 8 ns: as `north bench cost` starts QEMU.
    const INSTRUCTIONS_A_CYCLE: u32 = 5;
    const LATITUDE_DEG: f64 = 34.75;
    /// Painted stack that is left alone below the frame of the one who paints, bytes.
    const MARGIN: usize = 256;

    unsafe extern "C" {
        static mut _stack_end: u32;
    }

    /// Most of what was counted, of stack and of instructions.
    #[derive(Default)]
    struct Most {
        instructions: u32,
        stack_bytes: usize,
    }

    impl Most {
        #[inline(never)]
        fn measure(&mut self, work: impl FnOnce()) {
            let here = paint();
            let began = TIMER0.remaining();
            work();
            let instructions = began.wrapping_sub(TIMER0.remaining()) * INSTRUCTIONS_A_CYCLE;
            self.instructions = self.instructions.max(instructions);
            self.stack_bytes = self.stack_bytes.max(here - lowest());
        }

        fn tell(&self, name: &str, ram_bytes: usize) {
            hprintln!("{},{},{},{}", name, self.instructions, self.stack_bytes, ram_bytes);
        }
    }

    /// Paints the stack below its own frame; gives where that is.
    #[inline(never)]
    fn paint() -> usize {
        let mark = 0_u32;
        let here = black_box(&raw const mark) as usize;
        let mut at = &raw mut _stack_end;
        while (at as usize) < here - MARGIN {
            // SAFETY: from the stack's end to this frame nothing is in use.
            unsafe {
                at.write_volatile(cortex_m_rt::STACK_PAINT_VALUE);
                at = at.add(1);
            }
        }
        here
    }

    /// The lowest address where the paint is gone.
    fn lowest() -> usize {
        let mut at = &raw const _stack_end;
        // SAFETY: the stack was painted from its end on, and this frame ends the search.
        unsafe {
            while at.read_volatile() == cortex_m_rt::STACK_PAINT_VALUE {
                at = at.add(1);
            }
        }
        at as usize
    }

    #[entry]
    fn main() -> ! {
        TIMER0.run_freely();
        hold();
        filter(None);
        filter(Some(Vector3::z()));
        loop {
            debug::exit(debug::EXIT_SUCCESS);
        }
    }

    /// Standing for two seconds, turning for two.
    #[inline(never)]
    fn hold() {
        let mut keeper = Keeper::new(&BlockSettings::default(), LATITUDE_DEG, 0.01);
        keeper.fixed(&Fix {
            azimuth_deg: 40.0,
            sigma_deg: 0.04,
            closure_deg_h: None,
            closure_sigma_deg_h: None,
            chi_square: 0.0,
            degrees_of_freedom: 0,
            bias_deg_h: 0.0,
            amplitude_deg_h: 12.36,
            drift_deg_h_per_h: 0.0,
            tilt: Some(Tilt { pitch_deg: 0.05, roll_deg: -0.08 }),
            seconds: 240.0,
            flags: Flags::default(),
        });
        let mut counters = Counters::default();
        let (mut step, mut standing, mut moving) = (Most::default(), Most::default(), Most::default());
        for number in 1..=400 {
            // 4e-7 rad and 2e-3 rad of 2π, 1e-4 m/s and 0.098 m/s of 100 m/s, in counts of a 2³¹st of these.
            let turn = if number > 200 { 683_565 } else { 0 };
            let sample = Increments {
                angle: black_box([137, 137, 137 + turn]),
                velocity: black_box([2147, 2147, 2_104_534]),
                range: Range::Low,
                temperature: 250,
                missed: 0,
            };
            let most = match number {
                number if number % 100 != 0 => &mut step,
                number if number <= 200 => &mut standing,
                _ => &mut moving,
            };
            most.measure(|| {
                black_box(keeper.push(Some(&sample), &mut counters));
            });
        }
        let ram_bytes = size_of::<Keeper>();
        step.tell("heading hold, a 100 Hz step", ram_bytes);
        standing.tell("heading hold, the end of a second that stands", ram_bytes);
        moving.tell("heading hold, the end of a second that moves", ram_bytes);
    }

    /// Two seconds of the block with a velocity at the end of each, and the direction of an electrostatic gyro where there is one.
    #[inline(never)]
    fn filter(rotor: Option<Vector3<f64>>) {
        let attitude = Quaternion::from_rotation_vector(&Vector3::new(0.1, -0.2, 1.1)).direction_cosines();
        let navigation = Navigation::new(attitude, Vector3::new(8.0, -5.0, 0.3), 0.6, 0.3, 20.0);
        let installation = Installation { antenna_m: Vector3::new(1.0, 4.0, 10.0), baseline_m: Vector3::x() * 2.0 };
        let started = Filter::new(navigation, 0.4, BlockErrors::FOG, &StartSigmas::USUAL, installation, Mode::Aided);
        let Ok(mut filter) = started else { return };
        if let Some(direction) = &rotor {
            let errors = EsgErrors {
                direction_rad: 0.01,
                pick_off_rad: 1e-4,
                reading_rad: 2e-5,
                drift_rad_s: 1e-8,
                drift_growth_rad_s_per_sqrt_s: 1e-11,
                coefficient_rad_s: 1e-8,
            };
            filter.add_electrostatic(direction, DriftCoefficients::default(), errors);
        }
        let mut most = [Most::default(), Most::default(), Most::default(), Most::default()];
        let [step, second, update, pick_off] = &mut most;
        for number in 1..=200 {
            let increment = black_box(Increment {
                angle_rad: Vector3::new(2e-4, 3e-4, 5e-4),
                velocity_m_s: Vector3::new(0.005, -0.004, 0.098),
            });
            let most = if number % 100 == 0 { &mut *second } else { &mut *step };
            most.measure(|| {
                let _ = black_box(filter.advance(&BlockReading { dt_s: 0.01, increment, turn_rad: 0.4 }));
            });
            if number % 100 == 0 {
                let mean_m_s = Vector3::new(8.0, -5.0, 0.3);
                let velocity = Measurement::Velocity { mean_m_s, interval_s: 1.0, sigma_m_s: 0.1 };
                update.measure(|| {
                    let _ = black_box(filter.measure(&velocity));
                });
                if let Some(direction) = rotor {
                    let reading = Measurement::PickOff(PickOff { direction, sensor: 4 });
                    pick_off.measure(|| {
                        let _ = black_box(filter.measure(&reading));
                    });
                }
            }
        }
        let ram_bytes = size_of::<Filter>();
        if rotor.is_none() {
            step.tell("aided filter of 35 states, a 100 Hz step", ram_bytes);
            second.tell("aided filter of 35 states, a step that ends a second: covariance moved", ram_bytes);
            update.tell("aided filter of 35 states, a reading of velocity: three rows", ram_bytes);
        } else {
            second.tell("the same with an electrostatic gyro, 47 states: covariance moved", ram_bytes);
            update.tell("47 states, a reading of velocity: three rows", ram_bytes);
            pick_off.tell("47 states, a reading of the rotor: two rows", ram_bytes);
        }
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        loop {
            debug::exit(debug::EXIT_FAILURE);
        }
    }
}
