//! `curvelax run --dry-run`: the predicted cost of a run, as a table or as JSON; nothing is written.

use super::{print, print_json, report_flags::ReportFlags};
use crate::{
    backend::DeviceKind,
    ensemble::Spec,
    error::Result,
    estimate::{Estimate, Pilot},
    report::{Stop, words::machine},
    session::{Host, PlacedStudy},
    text::{bytes, count, duration, plural},
};

/// Estimates the run of `placed` by pilots that `stop` ends, and prints the estimate as `host` was asked to.
///
/// # Errors
/// Those of the run itself, and that of the stop.
pub fn dry_run(placed: PlacedStudy, stop: &Stop, host: &ReportFlags) -> Result<()> {
    placed.warnings().iter().for_each(|warning| host.say(&format!("warning: {warning}")));
    let PlacedStudy { study, choices, .. } = placed;
    let stopped = || Some(stop.asked()?.0.error(" in the pilot: nothing is saved"));
    let estimate = Estimate::new(&study, choices, host.checkpoint_every, &stopped)?;
    match (host.json, host.quiet) {
        (true, _) => print_json(&estimate),
        (false, false) => print(&table(&estimate, &study.cells()[0].spec)),
        (false, true) => Ok(()),
    }
}

/// The table.
fn table(estimate: &Estimate, spec: &Spec) -> String {
    let Estimate { members, cells, slots, pilot, .. } = estimate;
    let unknown = |what: &str| format!("unknown: the pilot was over before {what}");
    let on_gpu = |text: String| if estimate.platform.backend == DeviceKind::Gpu { text } else { String::new() };
    // Whether some members may need levels of which the pilot has not told.
    let is_open = spec.refine && estimate.finer_members.is_none() && estimate.most_points > spec.points;
    let rows = [
        ("members", format!("the run has {} in {cells} {}", count(*members, "member"), plural(*cells as u64, "cell"))),
        ("levels", levels(estimate, spec, is_open)),
        ("back end", format!("it runs on {}; solver {}", machine(&estimate.platform), spec.solver().name())),
        ("resident", format!("up to {} may be in progress at a time", count((*slots as u64).min(*members), "member"))),
        ("memory", format!("it needs about {}", bytes(estimate.memory_bytes))),
        ("disk", format!("its files take about {}", bytes(estimate.disk_bytes))),
        (
            "steps",
            estimate
                .steps_per_member
                .map_or(unknown("a member ended"), |steps| format!("each member takes about {steps:.0} on average")),
        ),
        (
            "dispatches",
            on_gpu(estimate.dispatches.map_or(unknown("a step"), |count| format!("there are about {count}"))),
        ),
        ("start-up", on_gpu(format!("it takes {}", duration(estimate.start_up_seconds)))),
        (
            "time",
            estimate.seconds.map_or(unknown("a step"), |seconds| {
                let without = if is_open { ", without resolutions of more nodes" } else { "" };
                format!("the run takes about {}{}{without}", duration(seconds), on_gpu(" after start-up".into()))
            }),
        ),
        ("pilot", started(pilot)),
    ];
    let told = rows.iter().filter(|(_, text)| !text.is_empty());
    told.map(|(label, text)| format!("{label:<11}{text}\n")).collect()
}

/// What became of the members of the pilot. If some failed, the rest of the estimate is that of short runs.
fn started(Pilot { members, ended, failed, seconds, .. }: &Pilot) -> String {
    let failed = match failed {
        0 => String::new(),
        _ => format!("; {failed} failed: a run with --only 0 says why"),
    };
    format!(
        "{members} runs of a member were started for this estimate, and {ended} ended, in {}{failed}",
        duration(*seconds)
    )
}

/// The further runs of members, for the error of discretisation.
fn levels(
    Estimate { level_members, finer_members, varied_members, most_points, .. }: &Estimate,
    spec: &Spec,
    is_open: bool,
) -> String {
    let finer = match *finer_members {
        Some(0) => String::new(),
        Some(finer) => {
            let need = if finer == 1 { "member needs" } else { "members need" };
            format!("; about {finer} {need} more nodes, up to n = {most_points}")
        }
        None if is_open => {
            format!(
                "; some members may need more nodes, up to n = {most_points}: the pilot was over before it could tell"
            )
        }
        None => String::new(),
    };
    let varied = match varied_members {
        0 => String::new(),
        members => format!("; {members} more are on other curves through the data points of the outlines"),
    };
    match *level_members {
        0 => "no member runs at other resolutions: the error of discretisation will be unknown".into(),
        runs => {
            let what = if spec.refine { "t_limit takes" } else { "the error of discretisation takes" };
            let runs = count(runs, "further run");
            format!("{what} {runs} of a member, at other resolutions{finer}{varied}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{number::Precision, placement::Platform};

    #[test]
    fn an_estimate_looks_like_this() {
        let platform = Platform {
            backend: DeviceKind::Cpu,
            adapter: None,
            driver: None,
            device_type: None,
            precision: Precision::F64,
            reason: "asked for".into(),
            threads: Some(2),
        };
        let estimate = Estimate {
            members: 3000,
            cells: 1,
            platform,
            slots: 128,
            level_members: 32,
            finer_members: None,
            varied_members: 0,
            most_points: 100,
            memory_bytes: 17_400_000,
            disk_bytes: 1_340_000_000,
            steps_per_member: Some(1999.6),
            dispatches: Some(740),
            start_up_seconds: 0.014,
            seconds: Some(31.9),
            pilot: Pilot { members: 130, ended: 130, failed: 0, relaxed: 129, rated: 120, seconds: 1.4 },
        };
        let expected = "\
members    the run has 3000 members in 1 cell
levels     the error of discretisation takes 32 further runs of a member, at other resolutions
back end   it runs on cpu, f64, 2 threads (asked for); solver gauss-seidel
resident   up to 128 members may be in progress at a time
memory     it needs about 17 MB
disk       its files take about 1.2 GB
steps      each member takes about 2000 on average
time       the run takes about 31.9 s
pilot      130 runs of a member were started for this estimate, and 130 ended, in 1.40 s
";
        assert_eq!(table(&estimate, &Spec::default()), expected);
        let on_gpu = Platform { backend: DeviceKind::Gpu, ..estimate.platform.clone() };
        let on_gpu = table(&Estimate { platform: on_gpu, ..estimate.clone() }, &Spec::default());
        let dispatched = "dispatches there are about 740\nstart-up   it takes 0.01 s\ntime       the run takes about 31.9 s after start-up\n";
        assert!(on_gpu.contains(dispatched), "{on_gpu}");
        let finer = Estimate { finer_members: Some(12), most_points: 1600, ..estimate.clone() };
        let told = "levels     the error of discretisation takes 32 further runs of a member, at other resolutions; about 12 members need more nodes, up to n = 1600\n";
        assert!(table(&finer, &Spec::default()).contains(told));
        let varied = Estimate { varied_members: 8, ..finer };
        assert!(
            table(&varied, &Spec::default())
                .contains("n = 1600; 8 more are on other curves through the data points of the outlines\n")
        );
        // Pilots that end before their members do not tell which need more nodes.
        let untold = Estimate { finer_members: None, most_points: 1600, ..estimate.clone() };
        let untold = table(&untold, &Spec { refine: true, ..Spec::default() });
        assert!(
            untold.contains("resolutions; some members may need more nodes, up to n = 1600: the pilot was over"),
            "{untold}"
        );
        assert!(
            untold.contains("time       the run takes about 31.9 s, without resolutions of more nodes\n"),
            "{untold}"
        );
        let little = Estimate { steps_per_member: None, dispatches: None, seconds: None, ..estimate };
        assert_eq!(table(&little, &Spec::default()).matches("unknown: the pilot was over before a").count(), 2);
    }
}
