//! Whether every task is alive, and how late the instrument is at most: the watchdog is fed only after all have checked in.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

/// Who can be late. The task that asks, `sample`, is the watchdog's own. `solve` and `idle` check in; work on a second or a
/// calibration that never ends keeps the idle task out. The report task says when it begins to send and when it is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Task {
    Solve = 1,
    Report = 2,
    Idle = 4,
}

/// Ticks within which every task checks in: a second. A calibration takes a tenth of that.
const PERIOD_TICKS: u32 = 400;

/// Who has checked in.
#[derive(Debug)]
pub struct Guard {
    seen: AtomicU8,
    /// A report is on its way out.
    sending: AtomicBool,
    /// Number of the tick under way, and of the one with which the period ends, but for their upper halves.
    now: AtomicU32,
    due: AtomicU32,
    load_permille: AtomicU32,
}

/// What a tick brings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The period is not over.
    Wait,
    /// All have checked in: feed the watchdog.
    Feed,
    /// A task has not.
    Late(Task),
}

impl Task {
    pub fn name(self) -> &'static str {
        match self {
            Self::Solve => "solve",
            Self::Report => "report",
            Self::Idle => "idle, work or calibrate",
        }
    }
}

impl Default for Guard {
    fn default() -> Self {
        Self::new()
    }
}

impl Guard {
    pub const fn new() -> Self {
        Self {
            seen: AtomicU8::new(0),
            sending: AtomicBool::new(false),
            now: AtomicU32::new(0),
            due: AtomicU32::new(PERIOD_TICKS - 1),
            load_permille: AtomicU32::new(0),
        }
    }

    /// A task is alive.
    pub fn check_in(&self, task: Task) {
        self.seen.fetch_or(task as u8, Ordering::Relaxed);
    }

    /// The report task begins to send, or is done.
    pub fn sending(&self, sending: bool) {
        self.check_in(Task::Report);
        self.sending.store(sending, Ordering::Relaxed);
    }

    /// At every tick, of this number.
    pub fn tick(&self, tick: u64) -> Verdict {
        // The lower half is enough, and quicker: differences hold round its end.
        let tick = tick as u32;
        self.now.store(tick, Ordering::Relaxed);
        let due = self.due.load(Ordering::Relaxed);
        let beyond = tick.wrapping_sub(due);
        if beyond.cast_signed() < 0 {
            return Verdict::Wait;
        }
        // While flash is erased ticks are lost: a period may end with a later one.
        self.due.store(due.wrapping_add(PERIOD_TICKS * (1 + beyond / PERIOD_TICKS)), Ordering::Relaxed);
        let seen = self.seen.swap(0, Ordering::Relaxed);
        let missing = |task: &Task| seen & *task as u8 == 0;
        // A report that neither began nor ended in this period has been on its way for all of it.
        let sending = self.sending.load(Ordering::Relaxed);
        let late = [Task::Solve, Task::Idle].into_iter().find(missing);
        late.or((sending && missing(&Task::Report)).then_some(Task::Report)).map_or(Verdict::Feed, Verdict::Late)
    }

    /// The work of a tick is done, with so much of the tick under way passed; whether that is another one already.
    pub fn done(&self, tick: u64, passed_permille: u32) -> bool {
        let behind = self.now.load(Ordering::Relaxed).wrapping_sub(tick as u32);
        let load_permille = behind.saturating_mul(1000).saturating_add(passed_permille);
        self.load_permille.fetch_max(load_permille, Ordering::Relaxed);
        behind > 0
    }

    /// Longest time from a tick to the end of its work, thousandths of a tick: 1000 and more is late.
    pub fn load_permille(&self) -> u32 {
        self.load_permille.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_watchdog_is_fed_only_when_all_are_alive() {
        let guard = Guard::new();
        let second = |seconds: u64, tasks: &[Task]| {
            tasks.iter().for_each(|&task| guard.check_in(task));
            let ticks = 400 * seconds..400 * (seconds + 1);
            let verdicts = ticks.map(|tick| guard.tick(tick)).filter(|&verdict| verdict != Verdict::Wait);
            verdicts.collect::<std::vec::Vec<_>>()
        };
        assert_eq!(second(0, &[Task::Solve, Task::Idle]), [Verdict::Feed]);
        assert_eq!(second(1, &[Task::Idle, Task::Idle]), [Verdict::Late(Task::Solve)]);
        assert_eq!(second(2, &[Task::Solve]), [Verdict::Late(Task::Idle)]);
        assert_eq!(second(3, &[Task::Idle, Task::Solve]), [Verdict::Feed]);
        // A report that takes its time, another one after it, and one that never ends.
        guard.sending(true);
        assert_eq!(second(4, &[Task::Idle, Task::Solve]), [Verdict::Feed]);
        guard.sending(false);
        guard.sending(true);
        assert_eq!(second(5, &[Task::Idle, Task::Solve]), [Verdict::Feed]);
        assert_eq!(second(6, &[Task::Solve]), [Verdict::Late(Task::Idle)]);
        assert_eq!(second(7, &[Task::Idle, Task::Solve]), [Verdict::Late(Task::Report)]);
        guard.sending(false);
        assert_eq!(second(8, &[Task::Idle, Task::Solve]), [Verdict::Feed]);
        assert_eq!(second(9, &[Task::Idle, Task::Solve]), [Verdict::Feed]);
    }

    /// The tick that ends a period is lost with seven others: the next one ends it, and the period after it has its own end.
    #[test]
    fn a_period_ends_though_its_last_tick_is_lost() {
        let guard = Guard::new();
        guard.check_in(Task::Solve);
        guard.check_in(Task::Idle);
        assert_eq!([398, 406, 407].map(|tick| guard.tick(tick)), [Verdict::Wait, Verdict::Feed, Verdict::Wait]);
        assert_eq!([798, 799].map(|tick| guard.tick(tick)), [Verdict::Wait, Verdict::Late(Task::Solve)]);
    }

    /// 2³² less 96 ticks are whole periods.
    #[test]
    fn periods_go_on_where_the_lower_half_of_the_number_ends() {
        let guard = Guard::new();
        let end = 1_u64 << 32;
        (0..end).step_by(1 << 30).chain([end - 97]).for_each(|tick| {
            guard.tick(tick);
        });
        let verdicts = (end - 96..end + 304).map(|tick| guard.tick(tick));
        assert_eq!(verdicts.filter(|&verdict| verdict != Verdict::Wait).count(), 1);
    }

    #[test]
    fn work_that_ends_after_the_next_tick_is_late() {
        let guard = Guard::new();
        guard.tick(7);
        guard.done(7, 300);
        assert_eq!(guard.load_permille(), 300);
        guard.tick(9);
        guard.done(7, 100);
        guard.done(9, 200);
        assert_eq!(guard.load_permille(), 2100);
    }
}
