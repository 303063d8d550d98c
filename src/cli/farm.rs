//! `pathspace farm`: writes a job that renders one picture in parts by samples, or a sequence in parts by frames, on an
//! engine that is there already, and that survives preemption. Nothing is submitted.
//!
//! * Slurm: `submit.sh` submits the array `array.sh` and, of parts by samples, `merge.sh` behind it. A task that is
//!   told to end saves its state, is requeued, and goes on from it; exit codes are the render's.
//! * OpenJD: `template.json`, a job bundle with a step that renders and one that merges. The last command of a task is
//!   the render itself, because cancelation reaches that process alone.
//!
//! What a merge writes it is asked for: half floats, previews, statistics. States of frames go when the frames are
//! there.
//!
//! Source: sbatch(1) of Slurm 22.05; Open Job Description 2023-09.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::frames::{self, Frames};
use super::output::EXIT_OK;
use super::report::Verbosity;
use crate::error::{Error, Result};
use crate::film::atomic::write_atomically;

/// Longest list of a task parameter that an OpenJD template may have.
const MOST_LISTED: usize = 1024;

/// Options that name a file to write, one for each frame.
const OUTPUTS: [&str; 5] = ["--png", "--jpg", "--jpeg", "--stats", "--report"];

/// Options that name a file to read.
const INPUTS: [&str; 2] = ["--env", "--reference"];

/// Options of the picture that a merge takes, because a part is none: flags, and those with a value.
const MERGED_FLAGS: [&str; 2] = ["--half", "--reproducible"];
const MERGED: [&str; 5] = ["--png", "--stats", "--exposure", "--pass-names", "--colorspace"];

/// Those that a merge does not know.
const NOT_MERGED: [&str; 9] =
    ["-o", "--output", "--jpg", "--jpeg", "--report", "--preview", "--tone-map", "--transparent", "--background"];

/// Seconds between the warning and the end of a task.
const NOTICE_SECONDS: u32 = 120;

/// `farm`.
#[derive(Debug, Args)]
#[command(after_help = "\
Example: pathspace farm slurm scene.gltf --spp 4096 --tasks 16 -o picture.exr --job job -- --width 1920\n\
Example: pathspace farm openjd scene.gltf --frames 1-100 --tasks 25 -o f.####.exr --job job -- --spp 256 --fps 24")]
pub struct FarmArgs {
    /// Who runs the job
    #[arg(value_enum)]
    pub engine: Engine,
    /// Scene, .gltf or .glb
    pub scene: PathBuf,
    /// Parts at most; of samples, each is a power of two
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub tasks: u64,
    /// Samples per pixel of the picture, which the tasks share
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..1 << 40),
        required_unless_present = "frames", conflicts_with = "frames"
    )]
    pub spp: Option<u64>,
    /// Frames, which the tasks share
    #[arg(long, value_name = "LIST", value_parser = frames::list)]
    pub frames: Option<Frames>,
    /// Picture or pictures to write, .exr
    #[arg(short, long, value_name = "FILE.exr")]
    pub output: PathBuf,
    /// Folder for the job, made if missing
    #[arg(long, value_name = "DIR")]
    pub job: PathBuf,
    /// Minutes after which Slurm ends a task, which is then requeued
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(4..))]
    pub minutes: u32,
    /// Processors of a task
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub cpus: u32,
    /// The program on the machines of the farm [default: this one]
    #[arg(long, value_name = "FILE")]
    pub program: Option<PathBuf>,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
    /// Options of every render, behind --
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    pub options: Vec<String>,
}

/// Values of `engine`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// Scripts for sbatch
    Slurm,
    /// A job bundle of Open Job Description (AWS Deadline Cloud, openjd-cli)
    Openjd,
}

impl FarmArgs {
    /// The words of a render of the first task, to be checked before anything is written.
    pub fn words(&self) -> Vec<String> {
        let part = self.frames.as_ref().map_or("0..1".into(), |frames| frames.0[0].to_string());
        let (scene, output) = (self.scene.to_string_lossy(), self.output.to_string_lossy());
        let files = ["pathspace", &scene, &output];
        self.task(str::to_owned, files, &self.options, [&part, "state", "--resume", "state"])
    }

    /// The words of a task's render of `[program, scene, output]`. A shell expands the part, where its state is and how
    /// it goes on from there; `word` spells all else.
    fn task(
        &self,
        word: impl Fn(&str) -> String,
        files: [&str; 3],
        options: &[String],
        part: [&str; 4],
    ) -> Vec<String> {
        let ([program, scene, output], [part, state, resume @ ..]) = (files.map(&word), part);
        let mut words = vec![program, "render".into(), scene];
        words.extend(options.iter().map(|option| word(option)));
        match self.frames {
            Some(_) => words.extend(["--frames", part, "--skip-existing", "-o", &output].map(String::from)),
            None => words.extend(["--sample-range", part].map(String::from)),
        }
        words.extend(["--checkpoint", "60s", state].map(String::from));
        words.extend(resume.iter().filter(|word| !word.is_empty()).map(|word| word.to_string()));
        words.extend(["--progress", self.engine.progress()].map(String::from));
        words
    }

    /// The options of every render and those of the merge. Engines run them in other folders, so files are named from
    /// the root. A task may have a single one of the frames and does not know of the others: their files are told apart
    /// here.
    ///
    /// # Errors
    /// [`Error::Option`] for what neither a part of a picture nor a merge knows.
    fn shared(&self) -> Result<(Vec<String>, Vec<String>)> {
        let (mut renders, mut merge) = (Vec::new(), Vec::new());
        let mut options = self.options.iter();
        while let Some(option) = options.next() {
            let (name, inline) = match option.split_once('=') {
                Some((name, value)) => (name, Some(value)),
                None => (option.as_str(), None),
            };
            if self.frames.is_none() && NOT_MERGED.contains(&name) {
                let problem = format!("{name}: a part is no picture, and a merge does not know the option");
                return Err(Error::Option { option: "RENDER OPTIONS", problem });
            }
            let is_merged = self.frames.is_none() && (MERGED.contains(&name) || MERGED_FLAGS.contains(&name));
            let words = if is_merged { &mut merge } else { &mut renders };
            let names_file = OUTPUTS.contains(&name) || INPUTS.contains(&name);
            if !(names_file || is_merged && MERGED.contains(&name)) {
                words.push(option.clone());
                continue;
            }
            words.push(name.into());
            let Some(value) = inline.or_else(|| options.next().map(String::as_str)) else { continue };
            words.push(match names_file {
                true if OUTPUTS.contains(&name) => text(&absolute(&self.numbered(Path::new(value)))?)?,
                true => text(&absolute(Path::new(value))?)?,
                false => value.into(),
            });
        }
        Ok((renders, merge))
    }

    /// A file's name with a place for the frame's number, where there are several.
    fn numbered(&self, path: &Path) -> PathBuf {
        let several = self.frames.as_ref().is_some_and(|frames| frames.0.len() > 1);
        if several { frames::pattern(path) } else { path.into() }
    }
}

impl Engine {
    /// How its renders report.
    fn progress(self) -> &'static str {
        match self {
            Engine::Slurm => "plain",
            Engine::Openjd => "openjd",
        }
    }
}

/// What the tasks do.
struct Job<'j> {
    args: &'j FarmArgs,
    program: String,
    scene: String,
    /// Folder of the job.
    folder: String,
    output: String,
    /// Options of every render, and of the merge.
    renders: Vec<String>,
    merge: Vec<String>,
    /// Each task's samples (`0..32`) or frames (`1-25`).
    parts: Vec<String>,
}

/// Runs the command.
pub fn run(args: &FarmArgs) -> Result<u8> {
    let verbosity = Verbosity::of(args.quiet, false);
    if args.output.extension().is_none_or(|end| end != "exr") {
        let problem = format!("{}: the name must end in .exr", args.output.display());
        return Err(Error::Option { option: "--output", problem });
    }
    if args.engine == Engine::Openjd
        && let Some(option) = args.options.iter().find(|option| option.contains("{{") || option.contains('\n'))
    {
        let problem = format!("'{option}' cannot stand in a template");
        return Err(Error::Option { option: "RENDER OPTIONS", problem });
    }
    let (renders, merge) = args.shared()?;
    fs::create_dir_all(args.job.join("parts")).map_err(|source| Error::io(&args.job, "make", source))?;
    fs::create_dir_all(args.job.join("logs")).map_err(|source| Error::io(&args.job, "make", source))?;
    let program = match &args.program {
        Some(program) => program.clone(),
        None => std::env::current_exe().map_err(|source| Error::io("pathspace", "find", source))?,
    };
    let job = Job {
        args,
        program: text(&program)?,
        scene: text(&absolute(&args.scene)?)?,
        folder: text(&absolute(&args.job)?)?,
        output: text(&absolute(&args.numbered(&args.output))?)?,
        renders,
        merge,
        parts: match &args.frames {
            Some(frames) => frame_lists(&frames.0, args.tasks as usize),
            None => sample_ranges(args.spp.unwrap_or(1), args.tasks),
        },
    };
    let start = match args.engine {
        Engine::Slurm => job.write_slurm()?,
        Engine::Openjd => job.write_openjd()?,
    };
    verbosity.note(format_args!("wrote a job of {} tasks; start it by {start}", job.parts.len()));
    Ok(EXIT_OK)
}

/// Ranges of one power of two that cover `spp` samples, `tasks` at most; the last may be shorter.
fn sample_ranges(spp: u64, tasks: u64) -> Vec<String> {
    let size = spp.div_ceil(tasks).next_power_of_two();
    (0..spp.div_ceil(size)).map(|task| format!("{}..{}", task * size, ((task + 1) * size).min(spp))).collect()
}

/// Lists of frames of `tasks` tasks at most, neighbours together.
fn frame_lists(frames: &[u32], tasks: usize) -> Vec<String> {
    let size = frames.len().div_ceil(tasks).max(1);
    let list = |frames: &[u32]| match frames {
        [first, .., last] if frames.windows(2).all(|pair| pair[1] == pair[0] + 1) => format!("{first}-{last}"),
        _ => frames.iter().map(u32::to_string).collect::<Vec<_>>().join(","),
    };
    frames.chunks(size).map(list).collect()
}

fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(|source| Error::io(path, "find", source))
}

/// A path as text; others cannot be written into a script.
fn text(path: &Path) -> Result<String> {
    let refuse =
        |problem: &str| Err(Error::Option { option: "--job", problem: format!("{}: {problem}", path.display()) });
    match path.to_str() {
        Some(text) if text.contains("{{") || text.contains('\n') => refuse("the path cannot stand in a job"),
        Some(text) => Ok(text.into()),
        None => refuse("the path is no text"),
    }
}

/// A word of a shell's command line.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

impl Job<'_> {
    /// The words of a task's render for a shell, whose variables say which part (`part`), and of one by samples where
    /// its state is (`state`) and how it goes on from there (`resume`).
    fn render(&self) -> String {
        let files = [&self.program, &self.scene, &self.output].map(String::as_str);
        let part = match self.args.frames {
            Some(_) => ["\"$part\"", "\"$state\"", "--resume", "\"$state\""],
            None => ["\"$part\"", "\"$state\"", "\"${resume[@]}\"", ""],
        };
        self.args.task(quoted, files, &self.renders, part).join(" ")
    }

    /// Sets `state`, and `resume` of a part by samples that is called `name`; frames find their states by their number.
    fn prepare(&self, name: &str) -> String {
        let folder = quoted(&format!("{}/parts/", self.folder));
        match self.args.frames {
            Some(_) => format!("state={folder}{name}.####.checkpoint\n"),
            None => format!(
                "state={folder}{name}.part\nresume=(); if [ -f \"$state\" ]; then resume=(--resume \"$state\"); fi\n",
            ),
        }
    }

    /// The words of the merge of these parts.
    fn merge(&self, parts: impl Iterator<Item = String>) -> Vec<String> {
        let parts = parts.map(|part| format!("{}/parts/{part}.part", self.folder));
        let words = ["merge".to_string()].into_iter().chain(parts).chain(self.merge.iter().cloned());
        words.chain(["-o".into(), self.output.clone()]).collect()
    }

    fn write(&self, name: &str, content: &str) -> Result<()> {
        let path = self.args.job.join(name);
        write_atomically(&path, |writer| std::io::Write::write_all(writer, content.as_bytes()))?;
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).map_err(|source| Error::io(path, "write", source))
    }

    fn write_slurm(&self) -> Result<String> {
        let (last, cpus, minutes) = (self.parts.len() - 1, self.args.cpus, self.args.minutes);
        let (folder, parts) = (&self.folder, self.parts.iter().map(|part| quoted(part)).collect::<Vec<_>>().join(" "));
        let logs = format!("{folder}/logs");
        let resume = self.prepare("\"$SLURM_ARRAY_TASK_ID\"");
        let render = self.render();
        let done = match self.args.frames {
            // Of frames that are there nothing is needed to go on from.
            Some(_) => "if [ $rc -eq 0 ]; then rm -f \"${state%####.checkpoint}\"*.checkpoint; fi\n",
            None => "",
        };
        let array = format!(
            r#"#!/bin/bash
#SBATCH --job-name=pathspace --array=0-{last} --cpus-per-task={cpus} --time={minutes}
#SBATCH --requeue --open-mode=append --signal=B:TERM@{NOTICE_SECONDS} --output="{logs}/%A_%a.log"
# A task that is warned saves its state, is requeued and goes on from it.
parts=({parts})
part=${{parts[$SLURM_ARRAY_TASK_ID]}}
{resume}{render} & pid=$!
trap 'kill -TERM $pid' TERM
wait $pid; rc=$?                       # returns early when the trap runs
while kill -0 $pid 2>/dev/null; do wait $pid; rc=$?; done
if [ $rc -eq 143 ]; then
  # Refused where Slurm has requeued it itself; else it waits to be ended.
  scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID" && sleep 60
fi
{done}exit $rc
"#
        );
        self.write("array.sh", &array)?;
        let mut submit =
            format!("#!/bin/bash\nset -e\njob=$(sbatch --parsable {})\n", quoted(&format!("{folder}/array.sh")));
        submit.push_str("echo \"Submitted batch job $job\"\n");
        if self.args.frames.is_none() {
            let words = self.merge((0..self.parts.len()).map(|task| task.to_string()));
            let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
            let merge = format!(
                "#!/bin/bash\n#SBATCH --job-name=pathspace-merge --output=\"{logs}/merge_%j.log\"\nexec {} {}\n",
                quoted(&self.program),
                words.join(" ")
            );
            self.write("merge.sh", &merge)?;
            let merge = quoted(&format!("{folder}/merge.sh"));
            submit.push_str(&format!("sbatch --dependency=afterok:$job --kill-on-invalid-dep=yes {merge}\n"));
        }
        self.write("submit.sh", &submit)?;
        Ok(format!("{folder}/submit.sh"))
    }

    fn write_openjd(&self) -> Result<String> {
        if self.parts.len() > MOST_LISTED {
            let problem = format!("{} tasks; an OpenJD template lists {MOST_LISTED} at most", self.parts.len());
            return Err(Error::Option { option: "--tasks", problem });
        }
        let folder = &self.folder;
        // A part's state is named by its first sample.
        let script = format!(
            "set -e\npart='{{{{Task.Param.Part}}}}'\n{}\
             # The render takes the place of the shell, because a cancelation reaches this process alone.\n\
             exec {}\n",
            self.prepare("\"${part%%..*}\""),
            self.render()
        );
        let cancelation = json!({ "mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": NOTICE_SECONDS });
        let render = json!({
            "name": "Render",
            "parameterSpace": {
                "taskParameterDefinitions": [{ "name": "Part", "type": "STRING", "range": self.parts }],
            },
            "hostRequirements": {
                "amounts": [{ "name": "amount.worker.vcpu", "min": self.args.cpus }],
                "attributes": [{ "name": "attr.worker.cpu.arch", "anyOf": ["x86_64"] }],
            },
            "script": {
                "actions": {
                    "onRun": { "command": "bash", "args": ["{{Task.File.Run}}"], "cancelation": cancelation },
                },
                "embeddedFiles": [{ "name": "Run", "type": "TEXT", "data": script }],
            },
        });
        let depends = json!([{ "dependsOn": "Render" }]);
        let last = match self.args.frames {
            None => {
                let first = |part: &String| part.split("..").next().unwrap_or_default().to_string();
                let on_run = json!({ "command": self.program, "args": self.merge(self.parts.iter().map(first)) });
                json!({ "name": "Merge", "dependencies": depends, "script": { "actions": { "onRun": on_run } } })
            }
            // Of frames that are there nothing is needed to go on from.
            Some(_) => {
                let args = [&format!("{folder}/parts"), "-name", "*.checkpoint", "-delete"];
                let on_run = json!({ "command": "find", "args": args });
                json!({ "name": "Clean", "dependencies": depends, "script": { "actions": { "onRun": on_run } } })
            }
        };
        let steps = [render, last];
        let template: Value =
            json!({ "specificationVersion": "jobtemplate-2023-09", "name": "pathspace", "steps": steps });
        let mut content = serde_json::to_string_pretty(&template).expect("a value is valid JSON");
        content.push('\n');
        self.write("template.json", &content)?;
        Ok(format!("openjd run {folder}/template.json"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: written by hand.
    #[test]
    fn parts_cover_everything_once() {
        assert_eq!(sample_ranges(64, 3), ["0..32", "32..64"]);
        assert_eq!(sample_ranges(64, 4), ["0..16", "16..32", "32..48", "48..64"]);
        assert_eq!(sample_ranges(100, 4), ["0..32", "32..64", "64..96", "96..100"]);
        assert_eq!(sample_ranges(1, 7), ["0..1"]);
        assert_eq!(frame_lists(&[1, 2, 3, 4, 5], 2), ["1-3", "4-5"]);
        assert_eq!(frame_lists(&[1, 3, 5, 7], 2), ["1,3", "5,7"]);
        assert_eq!(frame_lists(&[4], 9), ["4"]);
    }

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(quoted("it's $HOME"), r"'it'\''s $HOME'");
    }
}
