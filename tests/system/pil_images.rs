//! Wrong firmware images: reported before anything starts, with the file, its kind, the wanted kind and the
//! command that builds it; results of an earlier run stay. `cargo xtask pil` builds the images for this and
//! runs it.

use crate::program;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;
use wheeleg_protocol::SCHEMA_HASH;
use wheeleg_remote_host::unicorn;
use wheeleg_remote_link::image::{Identity, Kind, identify};

/// Begin of the record in a file (firmware/identity).
const MARK: &[u8] = b"WLIM";
/// Places in the record.
const VERSION: usize = 4;
const LINK: usize = 6;
const INTERFACE: usize = 8;
const SOURCES: usize = 16;

fn built(name: &str) -> PathBuf {
    unicorn::image(name).expect("an image: run `cargo xtask pil`")
}

/// A folder of images in which `name` has other contents.
struct Images(TempDir);

impl Images {
    fn with(name: &str, contents: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        for good in ["joint", "wheel"] {
            let to = folder.path().join(format!("{good}.elf"));
            std::fs::copy(built(good), to).expect("copied");
        }
        let path = folder.path().join(format!("{name}.elf"));
        std::fs::write(path, contents).expect("written");
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(format!("{name}.elf"))
    }

    /// A short run with `node` outside, in a folder with a result of an earlier one.
    fn run(&self, node: &str, further: &[&str]) -> Run {
        let out = tempfile::tempdir().expect("temporary folder");
        let earlier = out.path().join("summary.json");
        std::fs::write(&earlier, "an earlier run's").expect("written");
        let output = Command::new(program::path())
            .args(["run", "--json", "--node", node, "--out"])
            .arg(out.path())
            .args(further)
            .arg(short(out.path()))
            .env("WHEELEG_IMAGES", self.0.path())
            .env("NO_COLOR", "1")
            .output()
            .expect("the program");
        let text = std::fs::read_to_string(&earlier).unwrap_or_default();
        Run {
            output,
            earlier_stays: text == "an earlier run's",
        }
    }
}

/// A tenth of a second of standing.
fn short(folder: &Path) -> PathBuf {
    let source =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/scenarios/three-step.toml");
    let text = std::fs::read_to_string(source).expect("the scenario");
    let whole = "duration = { value = 10.0, unit = \"s\" }";
    assert!(text.contains(whole), "the scenario's duration");
    let text = text
        .replace(whole, "duration = { value = 0.1, unit = \"s\" }")
        .replace("targets = \"three-step\"", "targets = \"none\"");
    let path = folder.join("short.toml");
    std::fs::write(&path, text).expect("written");
    path
}

struct Run {
    output: Output,
    earlier_stays: bool,
}

impl Run {
    /// The program's output, without the frames and breaks of its error messages.
    fn says(&self) -> String {
        plain(&self.output.stderr)
    }

    /// Refused before anything was moved, in these words.
    fn assert_refused(&self, words: &[&str]) {
        let says = self.says();
        assert!(!self.output.status.success(), "{says}");
        assert!(self.earlier_stays, "earlier results were set aside");
        for word in words {
            assert!(says.contains(&squeezed(word)), "no `{word}` in: {says}");
        }
    }
}

/// Without white space: a long line is broken anywhere.
fn squeezed(text: &str) -> String {
    text.split_whitespace().collect()
}

fn plain(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let letters = text
        .chars()
        .filter(|c| !matches!(c, '│' | '×' | '╰' | '─' | '▶'));
    squeezed(&letters.collect::<String>())
}

/// An image whose record has other bytes from `place` on.
fn changed(name: &str, place: usize, bytes: &[u8]) -> Vec<u8> {
    let mut image = std::fs::read(built(name)).expect("the image");
    let mut found = image.windows(MARK.len()).enumerate();
    let marks: Vec<usize> = found
        .by_ref()
        .filter(|(_, w)| *w == MARK)
        .map(|(i, _)| i)
        .collect();
    let [mark] = marks[..] else {
        panic!("{name} has {} marks", marks.len());
    };
    image[mark + place..][..bytes.len()].copy_from_slice(bytes);
    image
}

#[test]
fn every_image_says_what_it_is() {
    let mut sources = Vec::new();
    for kind in [Kind::Joint, Kind::Wheel, Kind::JointHil, Kind::WheelHil] {
        let path = built(kind.name());
        let identity: Identity = identify(&path, &[kind], Some(SCHEMA_HASH)).expect("as wanted");
        sources.push(identity.sources);
        for other in Kind::ALL.into_iter().filter(|other| *other != kind) {
            let wrong = identify(&path, &[other], None).expect_err("another kind");
            let says = wrong.to_string();
            assert!(
                says.contains(&format!("is the image `{}`", kind.name())),
                "{says}"
            );
            assert!(
                says.contains(&format!("wanted is `{}`", other.name())),
                "{says}"
            );
            assert_eq!(wrong.build, other.build_command());
        }
    }
    assert!(sources.iter().all(|digest| *digest == sources[0]));
    assert_ne!(sources[0], [0; 24]);
}

#[test]
fn an_image_of_another_kind_is_refused() {
    for (node, name, is) in [
        ("joint3=pil", "joint", "wheel"),
        ("joint3=pil", "joint", "joint-hil"),
        ("wheel7=pil", "wheel", "joint"),
        ("joint1=qemu", "qemu-joint", "joint"),
    ] {
        let images = Images::with(name, &std::fs::read(built(is)).expect("the image"));
        let file = images.path(name).display().to_string();
        let command = if node.ends_with("qemu") {
            "cargo xtask qemu"
        } else {
            "cargo xtask firmware"
        };
        images.run(node, &[]).assert_refused(&[
            &file,
            &format!("is the image `{is}`"),
            &format!("wanted is `{name}`"),
            command,
        ]);
    }
}

#[test]
fn an_image_that_does_not_say_what_it_is_is_refused() {
    let joint = |place, bytes: &[u8]| changed("joint", place, bytes);
    for (contents, words) in [
        (joint(0, b"XXXX"), "does not say what image it is"),
        (joint(VERSION, &[9]), "image record of version 9"),
        (b"no ELF".to_vec(), "is no ELF file"),
    ] {
        let images = Images::with("joint", &contents);
        let file = images.path("joint").display().to_string();
        images.run("joint3=pil", &[]).assert_refused(&[
            &file,
            words,
            "wanted is `joint`",
            "cargo xtask firmware",
        ]);
    }
}

#[test]
fn an_image_of_another_bus_interface_is_refused() {
    let other = SCHEMA_HASH ^ 1;
    let images = Images::with("wheel", &changed("wheel", INTERFACE, &other.to_le_bytes()));
    images.run("wheel8=pil", &[]).assert_refused(&[
        &images.path("wheel").display().to_string(),
        &format!("has the bus interface {other:016x}"),
        &format!("{SCHEMA_HASH:016x}, that of this program"),
        &format!("{other:016x} is not an interface of this archive"),
        "cargo xtask firmware",
    ]);
    // A run without such a board does not care.
    assert!(images.run("joint3=pil", &[]).output.status.success());
}

#[test]
fn an_image_of_other_sources_gives_a_warning_and_no_verdict_on_equality() {
    let warning = squeezed("was built from other firmware sources than this program");
    let images = Images::with("joint", &changed("joint", SOURCES, &[0xA5; 24]));
    let run = images.run("joint3=pil", &[]);
    assert!(run.output.status.success(), "{}", run.says());
    assert!(run.says().contains(&warning), "{}", run.says());
    let compared = images.run("joint3=pil", &["--compare-sil"]);
    compared.assert_refused(&[
        &images.path("joint").display().to_string(),
        &warning,
        "cargo xtask firmware",
        "without --compare-sil",
    ]);
    // The same run with the unchanged image, without a message.
    let good = Images::with("joint", &std::fs::read(built("joint")).expect("the image"));
    let run = good.run("joint3=pil", &["--compare-sil"]);
    assert!(run.output.status.success(), "{}", run.says());
    assert!(!run.says().contains(&warning), "{}", run.says());
}

#[test]
fn a_bench_takes_bench_images_of_its_link_alone() {
    let start = |image: &Path| {
        let output = Command::new(unicorn::program().expect("the emulator"))
            .arg("--bench")
            .arg(image)
            .output()
            .expect("the emulator");
        (output.status.success(), plain(&output.stderr))
    };
    let other = changed("wheel-hil", LINK, &99_u16.to_le_bytes());
    let images = Images::with("wheel-hil", &other);
    for (image, words) in [
        (
            built("joint"),
            ["is the image `joint`", "wanted is `joint-hil`"],
        ),
        (
            images.path("wheel-hil"),
            ["speaks version 99 of the board link", "wanted is version"],
        ),
    ] {
        let (started, says) = start(&image);
        assert!(!started, "{says}");
        let file = image.display().to_string();
        for word in words
            .iter()
            .copied()
            .chain([&*file, "cargo xtask firmware"])
        {
            assert!(says.contains(&squeezed(word)), "no `{word}` in: {says}");
        }
    }
}
