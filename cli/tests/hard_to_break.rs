//! What is done to a command that nobody should do to it.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn north(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_north"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The output of a command that must end by itself, soon.
fn ended(mut child: Child) -> (Output, Duration) {
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(20) {
            let _ = child.kill();
            panic!("it goes on for ever");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    (child.wait_with_output().unwrap(), start.elapsed())
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn interrupt_and_terminate_end_a_command_at_once_and_its_folder_can_be_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let simulate =
        |runs: &str, out: &str| north(folder.path(), &["simulate", "--runs", runs, "--out", out]).spawn().unwrap();
    for name in ["-INT", "-TERM"] {
        let campaign = folder.path().join(name);
        let child = simulate("500", &format!("./{name}"));
        let start = Instant::now();
        while fs::read_dir(campaign.join("runs")).map_or(0, Iterator::count) == 0
            && start.elapsed() < Duration::from_secs(60)
        {
            std::thread::sleep(Duration::from_millis(10));
        }
        signal(&child, name);
        let (output, took) = ended(child);
        // Half a second of grace, and a machine that is busy.
        assert!(output.status.code() == Some(130) && took < Duration::from_secs(5), "{name}: {output:?} {took:?}");
        assert!(campaign.join("unfinished").exists() && !campaign.join("campaign.toml").exists());
        let (output, _) = ended(simulate("1", &format!("./{name}")));
        assert!(output.status.success(), "{output:?}");
        assert!(!campaign.join("unfinished").exists() && campaign.join("campaign.toml").exists());
    }
    // A finished one stays as it is.
    let (output, _) = ended(simulate("1", "./-INT"));
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("never overwritten"));
}

#[test]
fn pipes_and_devices_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    assert!(Command::new("mkfifo").arg(folder.path().join("pipe")).status().unwrap().success());
    for file in ["pipe", "/dev/zero"] {
        for command in [
            &["solve", file, "--latitude", "47"][..],
            &["align", file, "--latitude", "47"],
            &["load", file, "--port", "nowhere"],
        ] {
            let (output, _) = ended(north(folder.path(), command).spawn().unwrap());
            let error = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.code() == Some(1) && error.contains("no regular file"), "{command:?}: {error}");
        }
    }
}

#[test]
fn a_line_without_an_end_and_control_characters_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = fs::File::create(folder.path().join("endless.csv")).unwrap();
    file.write_all(b"t_s,index_deg,fog_arcsec\n1,0,\"").unwrap();
    file.write_all(&vec![b'7'; 40 << 20]).unwrap();
    fs::write(folder.path().join("red.toml"), "format = 1\n\"\x1b[31mred\" = 1\n").unwrap();
    let (output, _) = ended(north(folder.path(), &["solve", "endless.csv", "--latitude", "47"]).spawn().unwrap());
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && error.contains("more than 16 MiB") && error.len() < 1000, "{error}");
    let (output, _) = ended(north(folder.path(), &["find", "--host", "--model", "red.toml"]).spawn().unwrap());
    let said = [output.stdout, output.stderr].concat();
    assert!(output.status.code() == Some(1) && !said.contains(&0x1b), "{}", String::from_utf8_lossy(&said));
}

#[test]
fn nothing_is_overwritten_without_being_asked() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("mine.json"), "mine").unwrap();
    let find = ["find", "--host", "--order", "plain", "--dwell", "5", "--json", "mine.json"];
    let (output, _) = ended(north(folder.path(), &find).spawn().unwrap());
    assert!(
        output.status.code() == Some(1) && String::from_utf8_lossy(&output.stderr).contains("--force"),
        "{output:?}"
    );
    assert_eq!(fs::read_to_string(folder.path().join("mine.json")).unwrap(), "mine");
    let (output, _) = ended(north(folder.path(), &[&find[..], &["--force"]].concat()).spawn().unwrap());
    assert!(
        output.status.success() && fs::read(folder.path().join("mine.json")).unwrap().starts_with(b"{"),
        "{output:?}"
    );
}
