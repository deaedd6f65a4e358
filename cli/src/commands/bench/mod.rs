//! `north bench`: the project's own measurements; the README's tables come from here.

mod accuracy;
mod calibration;
mod cost;
mod diagnose;
mod diagnose_speed;

use clap::{Args, Subcommand};

use crate::failure::Failure;

/// Measure the project itself: accuracy and cost
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench accuracy --trials 4000")]
pub struct Bench {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Accuracy(accuracy::Accuracy),
    Calibration(calibration::Calibration),
    Cost(cost::CostCommand),
    Diagnose(diagnose::DiagnoseBench),
}

impl Bench {
    pub fn run(self) -> Result<(), Failure> {
        match self.what {
            What::Accuracy(accuracy) => accuracy.run(),
            What::Calibration(calibration) => calibration.run(),
            What::Cost(cost) => cost.run(),
            What::Diagnose(diagnose) => diagnose.run(),
        }
    }
}
