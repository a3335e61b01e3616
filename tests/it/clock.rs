//! The clock in two parts, which adds up exactly in either precision.

use curvelax::{
    schedule::Ticks,
    scheme::{Parameters, evolve::Evolves, member::Progress, pace},
};

/// The clock of a run to `t_end` in numbers of type T.
fn clock<T: Evolves>(t_end: f64, next: f64) -> (Ticks, Progress<T>, Parameters<T>) {
    let ticks = Ticks::new(t_end, T::PRECISION);
    let (end_high, end_low) = ticks.split(t_end);
    let p = Parameters { end_high, end_low, time_unit: ticks.unit, time_tick: ticks.tick, ..Parameters::default() };
    (ticks, Progress { next: T::of(next), ..Progress::default() }, p.convert())
}

#[test]
fn a_million_tiny_steps_add_up_exactly_in_f32() {
    let (ticks, mut progress, p) = clock::<f32>(2.0, 0.0);
    let (mut exact, mut naive) = (0_u64, 0.0_f32);
    for j in 0..1_000_000_u32 {
        // 16 to 115 ticks, and not an integer number.
        progress.next = (ticks.tick * (16.3 + f64::from(j % 100))) as f32;
        let stride = pace::stride(&progress, &p);
        assert!(!stride.last && stride.length > 0.0);
        exact += (f64::from(stride.length) / ticks.tick) as u64;
        naive += stride.length;
        pace::pass_time(&mut progress, stride, &p);
    }
    let time = f64::from(progress.time_high) + f64::from(progress.time_low);
    assert_eq!(time, exact as f64 * ticks.tick);
    assert_ne!(f64::from(naive), time, "the control passes");
}

#[test]
fn a_step_below_a_tick_moves_the_clock_by_one() {
    let (ticks, mut progress, p) = clock::<f32>(1e6, 1e-9);
    assert!(1e-9 < ticks.tick);
    for j in 1..=1000 {
        let stride = pace::stride(&progress, &p);
        pace::pass_time(&mut progress, stride, &p);
        assert_eq!(f64::from(progress.time_high) + f64::from(progress.time_low), f64::from(j) * ticks.tick);
    }
}
