//! The program under strace, which makes one of its system calls fail, or kills it there.

use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

use crate::common::Scratch;

/// System calls that change files. A question mark stands before those that not every processor has.
const CALLS: &str = "openat,write,fsync,?rename,?renameat,?renameat2,?link,?linkat,?unlink,?unlinkat,?mkdir,?mkdirat";

/// Stops at these calls only. It sends no signals.
const FAST: &str = "--seccomp-bpf";

/// A system call of the program.
#[derive(Clone, Debug)]
pub struct Call {
    /// The name.
    pub name: String,
    /// How many of this name its thread has made until then, with this one.
    nth: usize,
}

/// What happens at a system call, which is not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The disk is full.
    Full,
    /// The program is killed.
    Killed,
}

/// `program` under strace with these options.
fn strace(options: &[String], program: &Command) -> Command {
    let mut strace = Command::new("strace");
    strace.args(["--follow-forks", "--quiet=all"]);
    strace.args(["--signal=none", "--string-limit=0", "--decode-fds=path"]);
    strace.args(options).arg(program.get_program());
    strace.args(program.get_args());
    if let Some(folder) = program.get_current_dir() {
        strace.current_dir(folder);
    }
    strace
}

/// Runs `program`, which must succeed. Returns its calls that change files below `folder`.
#[track_caller]
pub fn calls(program: &Command, folder: &Path) -> Vec<Call> {
    let scratch = Scratch::new();
    let log = format!("--output={}", scratch.path("log").display());
    let trace = format!("--trace={CALLS}");
    let output = strace(&[FAST.to_owned(), log, trace], program).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{output:?}");
    let below = folder.canonicalize().unwrap();
    let written = format!("<{}", below.display());
    let mut made = HashMap::new();
    let mut calls = Vec::new();
    for line in scratch.read("log").lines() {
        let (thread, call) = line.split_once(' ').unwrap();
        // `<... write resumed>` was counted when it began.
        let Some((name, arguments)) = call.trim_start().split_once('(') else {
            continue;
        };
        let nth = made
            .entry((thread.to_owned(), name.to_owned()))
            .or_insert(0);
        *nth += 1;
        let changes = match name {
            "openat" => arguments.contains("O_CREAT"),
            "write" => arguments.split(',').next().unwrap().contains(&written),
            _ => true,
        };
        if changes {
            let (name, nth) = (name.to_owned(), *nth);
            calls.push(Call { name, nth });
        }
    }
    calls
}

/// `program` with a fault at this call.
pub fn faulty(program: &Command, call: &Call, fault: Fault) -> Command {
    let Call { name, nth } = call;
    let (fault, more) = match fault {
        Fault::Full => ("error=ENOSPC", Some(FAST.to_owned())),
        Fault::Killed => ("signal=KILL", None),
    };
    let options = [
        "--output=/dev/null".to_owned(),
        format!("--trace={name}"),
        format!("--inject={name}:{fault}:when={nth}"),
    ];
    strace(
        &options.into_iter().chain(more).collect::<Vec<_>>(),
        program,
    )
}
