#include "duet/experiment/plan/clips.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <optional>
#include <span>
#include <system_error>
#include <variant>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/motion/npz_fields.h"
#include "duet/motion/people/made_up.h"
#include "duet/motion/people/tracked_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/retarget/solver/pair.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

struct SyntheticClip {
  Task task;
  int index;
  std::uint64_t seed;
  Likeness like;
  bool cropped, tracked;
  const ClipVariant* variant;  // of the suite; null: as drawn
  bool varied = false;         // how long who is like people stands before the act, and how
};
struct ClipSource {
  std::variant<std::string, SyntheticClip> from;  // a file, or what is synthesised
  bool other_role = false;
};

std::string id_of(const SyntheticClip& clip) {
  std::string id = synthetic_clip_id(synthetic_manner(clip.like), to_string(clip.task), clip.seed, clip.index);
  if (clip.tracked) id = tracked_clip_id(id);
  return clip.variant == nullptr ? id : id + "-" + clip.variant->name;
}

// The tags of a suite's own clip, as its rows say them.
Tags tags_of(const SyntheticClip& clip) {
  Tags tags = {{std::string(kPeopleTag), std::string(kSyntheticPeople)}};
  if (clip.variant != nullptr) tags.merge(tags_of(*clip.variant));
  return tags;
}

// The kind of a file's people and what was made up of them, by what its clip says. A paired motion has tags of its own.
void add_people(const Npz& npz, PairedMotion& motion) {
  if (kind_of(npz) != MotionFile::kClip) return;
  const std::map<std::string, std::string> source = get_texts(npz, "source");
  motion.tags.insert_or_assign(std::string(kPeopleTag), is_synthesised(source) ? kSyntheticPeople : kRecordedPeople);
  if (const std::string kinds = made_up_kinds(source); !kinds.empty())
    motion.tags.insert_or_assign(std::string(kMadeUpTag), kinds);
}

// The people's, whoever of the two the robot replaces.
std::string people_digest(const PairedMotion& clip) {
  const auto digest = [](const HumanMotion& motion) {
    Sha256 sha256;
    sha256.update(std::span<const double>(motion.joints.data()));
    return sha256.hex();
  };
  const std::string partner = digest(clip.source_partner), reactor = digest(clip.source_reactor);
  return partner < reactor ? partner + reactor : reactor + partner;
}

// Clips that show one recording, as in the other role, name the first of them.
void note_recordings(std::vector<PairedMotion>& clips) {
  std::map<std::pair<std::string_view, std::string>, std::string> recordings;
  for (PairedMotion& clip : clips) {
    const auto [first, is_new] = recordings.try_emplace({to_string(clip.task), people_digest(clip)}, clip.clip_id);
    if (!is_new) clip.tags.insert_or_assign(std::string(kRecordingTag), first->second);
  }
}

// Each of `sources` in the roles that the suite asks for, the other one after its own.
std::vector<ClipSource> in_roles(const std::vector<ClipSource>& sources, ClipRoles roles) {
  std::vector<ClipSource> list;
  for (const ClipSource& source : sources) {
    list.push_back(source);
    if (roles == ClipRoles::kBoth) list.push_back({source.from, true});
  }
  return list;
}

void add_synthetic(Task task, int count, bool cropped, const SuiteClips& clips, std::vector<ClipSource>& sources) {
  SyntheticClip clip{task, 0, clips.synth_seed, clips.synth_like, cropped, clips.synth_tracked, nullptr};
  for (clip.index = 0; clip.index < count; ++clip.index) {
    clip.variant = nullptr;
    if (clips.variants.empty()) sources.push_back({clip});
    for (const ClipVariant& variant : clips.variants) {
      clip.variant = &variant;
      sources.push_back({clip});
    }
  }
}

// Files, or what is synthesised in their place.
std::vector<ClipSource> list_sources(const std::vector<Task>& tasks, const SuiteClips& clips) {
  std::vector<ClipSource> sources;
  for (const std::string& file : clips.files) sources.push_back({file});
  for (const Task task : tasks) add_synthetic(task, clips.synth_per_task, false, clips, sources);
  return in_roles(sources, clips.roles);
}

InteractionClip with_padding(InteractionClip clip, const ClipPadding& pad) {
  return pad.any() ? padded(clip, pad.before, pad.after) : std::move(clip);
}

constexpr double kStandingBefore = 4.0, kStandingAfter = 2.0;  // [s]; as recordings are padded

// A robot needs time to come and to go, and an act that is broken off is none to succeed in: who is like people stands
// before and after, and goes through with it.
void like_people(const SyntheticClip& source, SynthesisOptions& options) {
  constexpr double kHesitant = 0.1;
  Random random(source.seed, stream_key({"hesitates", to_string(source.task), std::to_string(source.index)}));
  options.like = source.like;
  if (source.like == Likeness::kVaried)
    options.wait = kStandingBefore;
  else
    options.before = kStandingBefore;
  options.after = kStandingAfter;
  options.outcome = random.chance(kHesitant) ? ActOutcome::kHesitant : ActOutcome::kComplete;
}

// Draws the wait without memory, so that a policy cannot count it; half of the clips are padded as recordings
// are: both people frozen in the first frame of the act. Nobody begins by himself before a partner who stands still
// but has looked at him for longer than D-STAR's memory of 4.4 s.
ClipPadding vary_standing(const SyntheticClip& source, SynthesisOptions& options) {
  constexpr double kComes = 2.5, kMeanWait = 1.5;  // who is like people: for the robot to come, and after that [s]
  constexpr double kLooksFor = 5.0, kMeanPatience = 1.0;  // before a partner who stands still [s]
  Random random(source.seed, stream_key({"stands", to_string(source.task), std::to_string(source.index)}));
  const auto drawn = [&](double mean) { return -mean * std::log1p(-random.uniform()); };
  const bool varied = source.like == Likeness::kVaried;
  double before = varied ? drawn(kStandingBefore) : kComes + drawn(kMeanWait);
  const double still = definition_of(source.task).act.varied.still;
  if (varied && still > 0.0) options.still = random.chance(still);
  if (options.still.value_or(false)) before = kLooksFor + drawn(kMeanPatience);
  if (random.chance(0.5)) {
    options.before = before;
    options.wait = std::nullopt;
    return {};
  }
  options.before = options.after = options.wait = std::nullopt;  // cropped as recordings are
  return {before, kStandingAfter};
}

InteractionClip synthesize(const SyntheticClip& source) {
  SynthesisOptions options;
  options.seed = source.seed;
  options.index = source.index;
  ClipPadding frozen;
  if (source.like != Likeness::kScripted) like_people(source, options);
  if (source.varied) frozen = vary_standing(source, options);
  if (source.cropped) options.before = options.after = options.wait = std::nullopt;
  if (source.variant != nullptr) vary(*source.variant, options);
  InteractionClip clip = synthesize(source.task, options);
  if (source.tracked) clip = add_tracker_noise(clip, tracker_of(clip, source.seed), source.seed);
  clip = with_padding(std::move(clip), frozen);
  clip.id = id_of(source);
  return clip;
}

// The label that tells a clip that is made from others.
std::string label_of(const SyntheticClip& clip) {
  std::string label = fmt::format("{} {} {}", to_string(clip.task), clip.seed, clip.index);
  if (clip.like != Likeness::kScripted) label += fmt::format(" like={}", name_of(likeness_names(), clip.like));
  if (clip.cropped) label += " cropped";
  if (clip.tracked) label += " tracked";
  if (clip.variant == nullptr) return label;
  label += " " + clip.variant->name;
  if (clip.variant->side) label += fmt::format(" {}", name_of(side_names(), *clip.variant->side));
  if (clip.variant->target_height) label += fmt::format(" {}", *clip.variant->target_height);
  if (clip.variant->distance) label += fmt::format(" distance={}", *clip.variant->distance);
  if (clip.variant->outcome) label += fmt::format(" {}", name_of(act_outcome_names(), *clip.variant->outcome));
  if (clip.variant->still) label += fmt::format(" still={}", *clip.variant->still);
  return label;
}

// The other person than before is whom the robot replaces.
InteractionClip in_other_role(InteractionClip clip) {
  set_reactor(clip, clip.reactor == Person::kA ? Person::kB : Person::kA);
  return clip;
}

// The text of what all clips of a suite have in common.
std::string maker_of(const Suite& suite, const RobotModel& robot) {
  std::string text =
      fmt::format("duet.prepared/1 {} {} {}", program_identity(), robot.digest, to_string(available_kernels().front()));
  for (const auto& [name, value] : suite.retarget) text += fmt::format("\n{}={}", name, value);
  if (suite.clips.pad.any()) text += fmt::format("\npad {} {}", suite.clips.pad.before, suite.clips.pad.after);
  return text;
}

// The clip that is kept under the label, or the one that `make` gives, which is kept then.
template <typename Make>
LoadedMotion find_or_make(const PreparedClips& prepared, const std::string& label, Make&& make) {
  if (std::optional<PairedMotion> clip = prepared.find(label)) return {std::move(*clip), {}};
  LoadedMotion made = make();
  prepared.keep(label, made.motion);
  return made;
}

struct DigestedNpz {
  Npz npz;
  std::string sha256;
};

DigestedNpz load_digested(const std::string& file, const FileDigests* expected) {
  FileDigests read;
  const DigestReads reads(read);
  Npz npz = Npz::load(file);
  const std::string sha256 = read.of(file), known = expected == nullptr ? "" : expected->find(file);
  if (!known.empty() && known != sha256)
    throw InputError(
        fmt::format("'{}' was replaced while it was used: SHA-256 expected {}, found {}", file, known, sha256));
  return {std::move(npz), sha256};
}

// A file that is only read is not kept.
LoadedMotion make_clip(const ClipSource& source, const RobotModel& robot, const PairOptions& options,
                       const ClipPadding& pad, const PreparedClips& prepared, const FileDigests* files) {
  const std::string role = source.other_role ? " other role" : "";
  if (const auto* file = std::get_if<std::string>(&source.from)) {
    const auto [npz, sha256] = load_digested(*file, files);
    const auto read = [&, &npz = npz] {
      return load_or_retarget(npz, robot, options, Implausible::kRefused, pad, source.other_role);
    };
    const bool keep = prepared.keeps() && kind_of(npz) == MotionFile::kClip;
    LoadedMotion made = keep ? find_or_make(prepared, sha256 + role, read) : read();
    add_people(npz, made.motion);
    return made;
  }
  const auto& clip = std::get<SyntheticClip>(source.from);
  const auto make = [&] {
    InteractionClip made = with_padding(synthesize(clip), pad);
    if (source.other_role) made = in_other_role(std::move(made));
    return LoadedMotion{retarget(made, robot, options), {}};
  };
  LoadedMotion made = prepared.keeps() ? find_or_make(prepared, label_of(clip) + role, make) : make();
  made.motion.tags = tags_of(clip);
  return made;
}

// A folder of clips that all lack phases is one matter, not a thousand lines.
void note_all(const std::vector<LoadedMotion>& made, Progress& progress) {
  constexpr int kMost = 10;
  int count = 0;
  for (const LoadedMotion& motion : made)
    for (const std::string& sentence : motion.notes)
      if (++count <= kMost) progress.note(sentence);
  if (count > kMost) progress.note(fmt::format("... and {} notes more", count - kMost));
}

std::vector<LoadedMotion> make_clips(const std::vector<ClipSource>& sources, const RobotModel& robot,
                                     const PairOptions& options, int threads, Progress& progress,
                                     const ClipPadding& pad = {}, const PreparedClips& prepared = {"", ""},
                                     const StopToken* stop = nullptr, const FileDigests* files = nullptr) {
  std::vector<LoadedMotion> made(sources.size());
  progress.start("preparing clips", static_cast<int>(sources.size()), "clips");
  parallel_for_each(static_cast<int>(sources.size()), threads, [&](int i) {
    if (stop != nullptr && stop->asked()) throw Stopped();
    made[i] = make_clip(sources[i], robot, options, pad, prepared, files);
    progress.advance();
  });
  progress.finish();
  note_all(made, progress);
  return made;
}

// Task by task, each task's in the order that they have; other tasks are left out.
std::vector<PairedMotion> by_task(std::vector<LoadedMotion> made, const std::vector<Task>& tasks) {
  std::vector<PairedMotion> clips;
  std::vector<bool> taken(made.size(), false);
  for (const Task task : tasks) {
    for (size_t i = 0; i < made.size(); ++i) {
      if (taken[i] || made[i].motion.task != task) continue;
      clips.push_back(std::move(made[i].motion));
      taken[i] = true;
    }
  }
  return clips;
}

// That a motion from a file is of this robot.
void check_robot(const PairedMotion& clip, const RobotModel& robot) {
  if (clip.robot.joint_names != robot.joint_names())
    throw InputError(fmt::format("clip '{}' was retargeted to another robot: its joints are not those of '{}'",
                                 clip.clip_id, robot.name));
  const int pairs = static_cast<int>(robot.pairs.size());
  if (!clip.reshaped.empty() && clip.reshaped.points() != pairs)
    throw InputError(fmt::format("clip '{}': key 'reshaped': expected the {} pairs of '{}', found {} points",
                                 clip.clip_id, pairs, robot.name, clip.reshaped.points()));
}

void check_ids(const std::vector<PairedMotion>& clips) {
  for (size_t i = 0; i < clips.size(); ++i) {
    for (size_t j = i + 1; j < clips.size(); ++j) {
      if (clips[i].clip_id == clips[j].clip_id && clips[i].task == clips[j].task)
        throw InputError(fmt::format("two clips of task {} have the id '{}'; ids name episodes and must differ",
                                     to_string(clips[i].task), excerpt(clips[i].clip_id)));
    }
  }
}

}  // namespace

MotionFile kind_of(const Npz& npz) {
  const std::string schema = npz.text("schema");
  if (schema == "duet.interaction_clip") return MotionFile::kClip;
  if (schema == "duet.paired_motion") return MotionFile::kPaired;
  if (schema == "duet.recording") return MotionFile::kRecording;
  throw InputError(fmt::format(
      "'{}': key 'schema': expected 'duet.interaction_clip', 'duet.paired_motion' or 'duet.recording', found '{}'",
      npz.name(), excerpt(schema)));
}

LoadedMotion load_or_retarget(const Npz& npz, const RobotModel& robot, const PairOptions& options,
                              Implausible implausible, const ClipPadding& pad, bool other_role) {
  return with_file_context(npz.name(), [&]() -> LoadedMotion {
    switch (kind_of(npz)) {
      case MotionFile::kClip: {
        ImportedClip read = read_foreign_clip(npz, implausible);
        InteractionClip clip = with_padding(std::move(read.clip), pad);
        if (other_role) clip = in_other_role(std::move(clip));
        return {retarget(clip, robot, options), other_role ? std::vector<std::string>() : std::move(read.notes)};
      }
      case MotionFile::kPaired:
        if (pad.any())
          throw InputError("expected a clip of two people, as only these can be padded, found a paired motion");
        if (other_role)
          throw InputError("expected a clip of two people, as only these have two roles, found a paired motion");
        return {read_paired_motion(npz), {}};
      case MotionFile::kRecording:
        break;
    }
    throw InputError(
        "expected a clip of two people or a paired motion (`duet synth`, `duet import A.bvh B.bvh` and `duet retarget` "
        "make them), found a recording of a robot, which `duet score` judges");
  });
}

PairOptions pair_options(const Suite& suite) {
  return make_pair_options({suite.retarget.begin(), suite.retarget.end()});
}

namespace {

// A command has a name and nothing else of a clip.
std::vector<PairedMotion> empty_clips(const std::vector<SuiteReference>& references) {
  std::vector<PairedMotion> clips(references.size());
  for (std::size_t i = 0; i < references.size(); ++i) clips[i].clip_id = references[i].name;
  return clips;
}

// Lists, beside clips of files, the synthesised ones of the same tasks, so many for each.
std::vector<ClipSource> list_twins(const std::vector<LoadedMotion>& read, const std::vector<Task>& tasks,
                                   const SuiteClips& clips) {
  std::vector<ClipSource> sources;
  for (const Task task : tasks) {
    const auto of_task = [&](const LoadedMotion& motion) { return motion.motion.task == task; };
    const auto count = static_cast<int>(std::ranges::count_if(read, of_task) / clips.copies());
    add_synthetic(task, count * clips.synth_per_file, true, clips, sources);
  }
  return in_roles(sources, clips.roles);
}

}  // namespace

std::map<std::string, Tags> synthetic_clips(const std::vector<Task>& tasks, const SuiteClips& clips) {
  const int files = static_cast<int>(clips.files.size());
  std::vector<ClipSource> sources;
  for (const Task task : tasks)
    add_synthetic(task, files > 0 ? files * clips.synth_per_file : clips.synth_per_task, files > 0, clips, sources);
  std::map<std::string, Tags> tags;
  for (const ClipSource& source : sources) {
    const auto& clip = std::get<SyntheticClip>(source.from);
    tags.emplace(id_of(clip), tags_of(clip));
  }
  return tags;
}

std::vector<PairedMotion> prepare_clips(const Suite& suite, const RobotModel& robot, int threads, Progress& progress,
                                        const PrepareOptions& prepare) {
  if (!suite.references.empty()) return empty_clips(suite.references);
  const PreparedClips prepared(prepare.keep_in, maker_of(suite, robot));
  const auto make = [&](const std::vector<ClipSource>& sources) {
    return make_clips(sources, robot, pair_options(suite), threads, progress, suite.clips.pad, prepared, prepare.stop,
                      prepare.files);
  };
  std::vector<LoadedMotion> made = make(list_sources(suite.tasks, suite.clips));
  if (suite.clips.synth_per_file > 0)
    std::ranges::move(make(list_twins(made, suite.tasks, suite.clips)), std::back_inserter(made));
  std::vector<PairedMotion> clips = by_task(std::move(made), suite.tasks);
  if (clips.empty()) throw InputError(fmt::format("{}: no clip is left for the tasks of the suite", suite.file));
  for (const PairedMotion& clip : clips) check_robot(clip, robot);
  check_ids(clips);
  note_recordings(clips);
  return clips;
}

std::vector<PairedMotion> synthetic_clips(const RobotModel& robot, const PairOptions& pair,
                                          const std::vector<Task>& tasks, int per_task, std::uint64_t seed, int threads,
                                          Progress& progress, Likeness like) {
  SuiteClips clips;
  clips.synth_like = like;
  clips.synth_per_task = per_task;
  clips.synth_seed = seed;
  std::vector<ClipSource> sources = list_sources(tasks, clips);
  for (ClipSource& source : sources) std::get<SyntheticClip>(source.from).varied = like != Likeness::kScripted;
  return by_task(make_clips(sources, robot, pair, threads, progress), tasks);
}

bool is_dataset(const std::string& folder) { return fs::exists(fs::path(folder) / "dataset.json"); }

namespace {

std::string people_folder(const std::string& dataset) {
  const fs::path people = fs::path(dataset) / "people";
  if (!fs::exists(people) || fs::is_empty(people))
    throw InputError(
        fmt::format("'{}' is a data set in which no recording was kept: its tables/refused.csv says why, "
                    "and `--gates` of `duet dataset` by which gates recordings are judged",
                    dataset));
  return people.string();
}

}  // namespace

void use_clips(const std::vector<std::string>& paths, Suite& suite) {
  if (paths.empty()) return;
  require(suite.references.empty(), "clips: the suite has a `reference` and no clips");
  if (suite.clips.synth_per_task > 0) suite.clips = {.files = {}, .pad = suite.clips.pad, .roles = suite.clips.roles};
  suite.clips.given = false;
  suite.clips.files.clear();
  for (const std::string& file : find_clip_files(paths)) suite.clips.files.push_back(fs::absolute(file).string());
}

std::vector<std::string> find_clip_files(const std::vector<std::string>& paths) {
  std::vector<std::string> places;
  places.reserve(paths.size());
  for (const std::string& path : paths) places.push_back(is_dataset(path) ? people_folder(path) : path);
  return find_motion_files(places);
}

std::vector<std::string> find_motion_files(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::exists(path)) throw InputError(fmt::format("cannot read '{}': No such file or directory", path));
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> found;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path))
      if (entry.is_regular_file() && entry.path().extension() == ".npz") found.push_back(entry.path().string());
    if (found.empty()) throw InputError(fmt::format("'{}' holds no .npz file", path));
    std::sort(found.begin(), found.end());
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

std::string PreparedClips::name_of(const std::string& source) const {
  return fmt::format("prepared/{:.32}.npz", sha256_hex(fmt::format("{}\n{}", made_by_, source)));
}

std::optional<PairedMotion> PreparedClips::find(const std::string& source) const {
  if (!keeps()) return std::nullopt;
  const std::string path = (std::filesystem::path(folder_) / name_of(source)).string();
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
  try {
    return load_paired_motion(path);
  } catch (const InputError&) {
    return std::nullopt;  // damaged: made anew
  }
}

void PreparedClips::keep(const std::string& source, const PairedMotion& clip) const {
  try {
    if (keeps()) save_paired_motion(clip, join_without_links(folder_, name_of(source)));
  } catch (const StorageError&) {
    return;  // it saves time, nothing else: where the disk is full, the first row says so
  }
}

void remove_prepared_clips(const std::string& folder) {
  const fs::path prepared = fs::path(folder) / "prepared";
  std::error_code ignored;
  if (!fs::is_directory(fs::symlink_status(prepared, ignored))) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(prepared, ignored)) {
    const fs::path name = entry.path().filename();
    const std::string digest = name.stem().string();
    const bool is_digest = digest.size() == 32 && digest.find_first_not_of("0123456789abcdef") == std::string::npos;
    if (is_digest && name.extension() == ".npz") fs::remove(entry.path(), ignored);
  }
  fs::remove(prepared, ignored);  // where nobody has put anything else into it
}

std::string program_identity() {
  struct stat program {};
  if (::stat(program_file().c_str(), &program) != 0) return duet_version();
  return fmt::format("{} {} {}.{:09}", duet_version(), program.st_size, program.st_mtim.tv_sec,
                     program.st_mtim.tv_nsec);
}

}  // namespace duet
