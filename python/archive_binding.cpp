// Clips, paired motions and recordings as read-only arrays; retargeting, scores and detectors over them.
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "duet/archives/npy/npz.h"
#include "duet/archives/recording_file.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/datasets/entry.h"
#include "duet/datasets/people_clip.h"
#include "duet/experiment/plan/clips.h"
#include "duet/formats/robot_motion_format.h"
#include "duet/metrics/detector.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/people/people_detection.h"
#include "duet/motion/plausibility.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/people/formats/people_formats.h"
#include "duet/python/bindings.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/robot_model.h"
#include "duet/rows/json_fields.h"
#include "duet/scoring/motion_scores.h"
#include "duet/scoring/recording_scores.h"

namespace duet::python {
namespace {

// The arrays of a file of motion, checked by that file's own reader. Immutable: arrays are views of it.
struct Archive {
  Npz npz;
  std::string kind;  // "clip", "paired", "recording", "robot"
};

Archive checked(Npz npz) {
  switch (kind_of(npz)) {
    case MotionFile::kClip:
      static_cast<void>(read_clip(npz));
      return {std::move(npz), "clip"};
    case MotionFile::kPaired:
      static_cast<void>(read_paired_motion(npz));
      return {std::move(npz), "paired"};
    case MotionFile::kRecording:
      static_cast<void>(read_recording(npz));
      return {std::move(npz), "recording"};
  }
  throw InputError(fmt::format("'{}': expected a clip, a paired motion or a recording", npz.name()));
}

// Numbers as a view whose owner is the archive; texts as a list; a scalar as itself.
py::object item(const py::object& self, const std::string& key) {
  const NpyArray& array = self.cast<const Archive&>().npz.array(key);
  const std::vector<py::ssize_t> shape(array.shape.begin(), array.shape.end());
  if (const auto* numbers = std::get_if<std::vector<double>>(&array.values)) {
    if (shape.empty()) return py::float_(numbers->front());
    return view_of(numbers->data(), shape, self);
  }
  if (const auto* integers = std::get_if<std::vector<std::int64_t>>(&array.values)) {
    if (shape.empty()) return py::int_(integers->front());
    return view_of(integers->data(), shape, self);
  }
  const auto& texts = std::get<std::vector<std::string>>(array.values);
  if (shape.empty()) return py::str(texts.front());
  return py::cast(texts);
}

PointTracks tracks_of(const Numbers& joints, const char* who) {
  if (joints.ndim() != 3 || joints.shape(1) != kSmplJoints || joints.shape(2) != 3) {
    const std::vector<py::ssize_t> shape(joints.shape(), joints.shape() + joints.ndim());
    throw std::invalid_argument(fmt::format("{}: expected joints of shape (frames, {}, 3), found ({})", who,
                                            kSmplJoints, fmt::join(shape, ", ")));
  }
  return {static_cast<int>(joints.shape(0)), kSmplJoints, {joints.data(), joints.data() + joints.size()}};
}

using Texts = std::map<std::string, std::string>;

// People of others are judged where they come in, as the command line judges them.
void require_plausible(const InteractionClip& clip, const std::string& what, bool as_is) {
  if (as_is) return;
  const std::vector<std::string> faults = judge_people(clip).faults;
  if (!faults.empty())
    throw InputError(fmt::format("{}: {} (as_is=True takes the clip nevertheless)", what, faults.front()));
}

Archive loaded(const std::string& path, bool as_is) {
  Archive archive = checked(Npz::load(path));
  if (archive.kind == "clip") require_plausible(read_clip(archive.npz), fmt::format("'{}'", path), as_is);
  return archive;
}

PairOptions pair_options_from(const Texts& options) { return make_pair_options({options.begin(), options.end()}); }

Archive clip_archive(const InteractionClip& clip) {
  return {Npz::parse(clip_bytes(clip, ZipMethod::kStored), clip.id), "clip"};
}
Archive paired_archive(const PairedMotion& motion) {
  return {Npz::parse(paired_motion_bytes(motion, ZipMethod::kStored), motion.clip_id), "paired"};
}

Person person_of(const std::string& name) {
  require(name == "A" || name == "B", "reactor: expected A or B, found '{}'", name);
  return name == "A" ? Person::kA : Person::kB;
}

// Two people as arrays of joints.
Archive make_clip(const Numbers& a, const Numbers& b, double rate_hz, const std::string& task,
                  const std::string& reactor, const std::optional<std::pair<int, int>>& act, const std::string& id,
                  bool as_is) {
  InteractionClip clip;
  clip.id = id;
  clip.task = parse_task(task);
  clip.a = {.rate_hz = rate_hz, .joints = tracks_of(a, "a"), .rotations = {}};
  clip.b = {.rate_hz = rate_hz, .joints = tracks_of(b, "b"), .rotations = {}};
  clip.reactor = person_of(reactor);
  validate(clip.a, "a");
  validate(clip.b, "b");
  require_plausible(clip, "the two people", as_is);
  clip.phases = act ? Phases{act->first, act->second} : propose_phases(clip.a, clip.b, clip.task);
  validate(clip);
  return clip_archive(clip);
}

Archive retarget_clip(const Archive& archive, const Texts& options, const std::string& card,
                      const std::string& reactor) {
  require(archive.kind == "clip", "retarget: expected a clip of two people, found a {}", archive.kind);
  InteractionClip clip = read_clip(archive.npz);
  if (!reactor.empty()) set_reactor(clip, person_of(reactor));
  return paired_archive(retarget(clip, *load_shared_robot(card), pair_options_from(options)));
}

ScoreOptions score_options(const Texts& readings, const std::string& thresholds) {
  ScoreOptions options;
  for (const auto& [name, value] : readings) set_reading(options.readings, name, value);
  options.thresholds = parse_threshold_set(thresholds);
  return options;
}

// JSON as `duet score --json` prints it for one file.
std::string score(const Archive& archive, const Texts& readings, const std::string& thresholds,
                  const std::string& card) {
  const ScoreOptions options = score_options(readings, thresholds);
  if (archive.kind == "recording") {
    const auto robot = card.empty() ? nullptr : load_shared_robot(card);
    return dumped(recordings_json({score_recording_file(archive.npz.name(), archive.npz, robot, options)}).at(0));
  }
  const auto robot = load_shared_robot(card);
  const ClipScore scored =
      score_clip(load_or_retarget(archive.npz, *robot, {}, Implausible::kAllowed).motion, robot, options);
  return dumped(score_json({scored}, summarize_scores({scored}, options.readings.metrics)).at("clips").at(0));
}

// The two whom a detector looks at: the human first. In a clip, the reactor stands for the robot.
std::pair<Agent, Agent> agents_of(const Archive& archive, const std::string& card) {
  if (archive.kind == "clip") {
    const InteractionClip clip = read_clip(archive.npz);
    return {human_agent(clip.actor_motion().joints), human_agent(clip.reactor_motion().joints)};
  }
  const auto robot = load_shared_robot(card);
  if (archive.kind == "paired") {
    const PairedMotion motion = read_paired_motion(archive.npz);
    return {human_agent(motion.partner.joints), robot_agent(*robot, motion.robot)};
  }
  const Recording recording = read_recording(archive.npz);
  if (recording.partner.empty())
    throw InputError(fmt::format("'{}': expected a partner, found none", archive.npz.name()));
  return {human_agent(recording.partner), robot_agent(*robot, recording.robot)};
}

std::string detect_in(const Archive& archive, const std::string& task, const std::string& version,
                      const std::string& thresholds, const std::string& card) {
  require(version == "robot" || version == "paper", "version: expected robot or paper, found '{}'", version);
  const auto [human, robot] = agents_of(archive, card);
  const DetectorResult result =
      detect(parse_task(task), human, robot, version == "robot" ? DetectorVersion::kRobot : DetectorVersion::kPaper,
             parse_threshold_set(thresholds));
  nlohmann::json values = nlohmann::json::object(), margins = nlohmann::json::object();
  for (const auto& [name, value] : result.values) values[name] = number_or_null(value);
  for (const auto& [name, value] : result.margins) margins[name] = number_or_null(value);
  return dumped(nlohmann::json({{"success", result.success},
                                {"parts", result.parts.map()},
                                {"values", values},
                                {"margins", margins},
                                {"frames", result.frames}}));
}

// Clips of others below some paths, one read at a time.
class PeopleReader {
 public:
  PeopleReader(const std::vector<std::string>& paths, const std::string& format, const std::string& task,
               const std::string& reactor, std::optional<double> rate_hz, const std::string& up,
               std::optional<double> metres_per_unit) {
    if (!task.empty()) options_.task = parse_task(task);
    if (!reactor.empty()) options_.reactor = person_of(reactor);
    if (!up.empty()) options_.up = parse_axis(up);
    options_.rate_hz = rate_hz;
    options_.metres_per_unit = metres_per_unit;
    format_ = &find_people_format(paths, format);
    places_ = format_->find(paths, options_);
  }
  [[nodiscard]] std::size_t size() const { return places_.size(); }
  [[nodiscard]] std::string format() const { return std::string(format_->name); }
  [[nodiscard]] std::pair<Archive, std::vector<std::string>> at(std::size_t i) const {
    require(i < places_.size(), "people: expected a place below {}, found {}", places_.size(), i);
    const PeopleClip read = read_people_clip(*format_, places_[i], options_);
    if (!read.source)
      throw InputError(fmt::format("'{}': its label '{}' is none of the tasks: say which it is (task=...)",
                                   places_[i].id, read.label));
    return {clip_archive(read.source->clip), read.source->evidence};
  }

 private:
  PeopleOptions options_;
  const PeopleFormat* format_ = nullptr;  // in the table of formats
  std::vector<ClipPlace> places_;
};

Archive motion_archive(const RobotMotionFile& file) {
  const RobotMotion& motion = file.motion;
  const auto frames = static_cast<std::size_t>(motion.frames());
  Npz npz;
  std::vector<double> positions, quaternions;
  for (const Pose& X : motion.root) {
    positions.insert(positions.end(), {X.p.x(), X.p.y(), X.p.z()});
    quaternions.insert(quaternions.end(), {X.R.w(), X.R.x(), X.R.y(), X.R.z()});
  }
  npz.set("root_position", std::move(positions), {frames, 3});
  npz.set("root_quat_wxyz", std::move(quaternions), {frames, 4});
  npz.set("q", std::vector<double>(motion.q.data(), motion.q.data() + motion.q.size()),
          {frames, static_cast<std::size_t>(motion.q.rows())});
  npz.set("joint_names", motion.joint_names);
  npz.set_number("rate_hz", motion.rate_hz);
  npz.set_text("format", file.format);
  npz.set("evidence", file.evidence);
  return {std::move(npz), "robot"};
}

RobotMotion robot_motion_of(const Archive& archive) {
  if (archive.kind == "paired") return read_paired_motion(archive.npz).robot;
  require(archive.kind == "robot", "robot motion: expected a paired motion or one of a robot, found a {}",
          archive.kind);
  const Npz& npz = archive.npz;
  RobotMotion motion{npz.number("rate_hz"), npz.strings("joint_names", {-1}), {}, {}};
  const std::vector<double> p = npz.numbers("root_position", {-1, 3}), w = npz.numbers("root_quat_wxyz", {-1, 4}),
                            q = npz.numbers("q", {-1, -1});
  for (std::size_t t = 0; t < p.size() / 3; ++t)
    motion.root.push_back(
        {{w[4 * t], w[4 * t + 1], w[4 * t + 2], w[4 * t + 3]}, {p[3 * t], p[3 * t + 1], p[3 * t + 2]}});
  motion.q = Eigen::Map<const Eigen::MatrixXd>(q.data(), static_cast<Eigen::Index>(motion.joint_names.size()),
                                               motion.frames());
  return motion;
}

std::string dataset_entries(const std::string& folder) {
  nlohmann::json entries = nlohmann::json::array();
  for (const DatasetEntry& entry : read_dataset(folder)) entries.push_back(nlohmann::json::parse(entry_line(entry)));
  return dumped(entries);
}

void add_readers(py::module_& module) {
  const auto released = py::call_guard<py::gil_scoped_release>();
  py::class_<PeopleReader>(module, "PeopleReader", "Recordings of two people, in a format of others.")
      .def(py::init<const std::vector<std::string>&, const std::string&, const std::string&, const std::string&,
                    std::optional<double>, const std::string&, std::optional<double>>(),
           py::arg("paths"), py::arg("format"), py::arg("task"), py::arg("reactor"), py::arg("rate_hz"), py::arg("up"),
           py::arg("metres_per_unit"), released)
      .def("__len__", &PeopleReader::size)
      .def_property_readonly("format", &PeopleReader::format)
      .def("at", &PeopleReader::at, py::arg("i"), released, "A clip, and what was found of its units and axes.");
  module.def(
      "read_robot_motion",
      [](const std::string& path, const std::string& format, const std::string& card) {
        return motion_archive(read_robot_motion(path, *load_shared_robot(card), {}, format));
      },
      py::arg("path"), py::arg("format"), py::arg("card"), released);
  module.def(
      "write_robot_motion",
      [](const Archive& motion, const std::string& path, const std::string& format, const std::string& card) {
        write_robot_motion(robot_motion_of(motion), *load_shared_robot(card), robot_motion_format(format), path);
      },
      py::arg("motion"), py::arg("path"), py::arg("format"), py::arg("card"), released);
  module.def("robot_motion_formats", &robot_motion_format_names);
  module.def("people_formats", &people_format_names);
  module.def("dataset_entries", &dataset_entries, py::arg("folder"), released);
}

}  // namespace

void add_archive(py::module_& module) {
  const auto released = py::call_guard<py::gil_scoped_release>();
  py::class_<Archive>(module, "Archive", "A file of motion: read-only arrays by key.")
      .def_property_readonly("kind", [](const Archive& archive) { return archive.kind; })
      .def_property_readonly("name", [](const Archive& archive) { return archive.npz.name(); })
      .def("keys", [](const Archive& archive) { return archive.npz.keys(); })
      .def("__contains__", [](const Archive& archive, const std::string& key) { return archive.npz.contains(key); })
      .def("__getitem__", &item, py::arg("key"), "A view, read-only; texts as a list.")
      .def(
          "save", [](const Archive& archive, const std::string& path) { archive.npz.save(path); }, py::arg("path"),
          released)
      .def(py::pickle(
          [](const Archive& archive) {
            return py::make_tuple(py::bytes(archive.npz.bytes(ZipMethod::kStored)), archive.npz.name(), archive.kind);
          },
          [](const py::tuple& state) {
            return Archive{Npz::parse(state[0].cast<std::string>(), state[1].cast<std::string>()),
                           state[2].cast<std::string>()};
          }));
  module.def("load", &loaded, py::arg("path"), py::arg("as_is"), released);
  module.def("make_clip", &make_clip, py::arg("a"), py::arg("b"), py::arg("rate_hz"), py::arg("task"),
             py::arg("reactor"), py::arg("act"), py::arg("id"), py::arg("as_is"));
  module.def(
      "synthesize",
      [](const std::string& task, std::uint64_t seed, int index) {
        SynthesisOptions options;
        options.seed = seed;
        options.index = index;
        return clip_archive(synthesize(parse_task(task), options));
      },
      py::arg("task"), py::arg("seed"), py::arg("index"), released);
  module.def("retarget", &retarget_clip, py::arg("clip"), py::arg("options"), py::arg("card"), py::arg("reactor"),
             released);
  module.def("score", &score, py::arg("motion"), py::arg("readings"), py::arg("thresholds"), py::arg("card"), released);
  module.def("detect", &detect_in, py::arg("motion"), py::arg("task"), py::arg("version"), py::arg("thresholds"),
             py::arg("card"), released);
  add_readers(module);
}

}  // namespace duet::python
