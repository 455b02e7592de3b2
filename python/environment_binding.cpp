// Many episodes that Python leads in step, and what they see as live arrays.
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "duet/core/require.h"
#include "duet/execution/stepped_episodes.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/policies/language.h"
#include "duet/policies/plan_queue.h"
#include "duet/python/bindings.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/json_fields.h"

namespace duet::python {
namespace {

// Place in a frame and size of what a view shows; the layout is that of to_vector (policies/policy.h).
struct Part {
  const char* name;
  int first, size;
};

// The robot that is led: of the experiment's one controller.
const RobotModel& robot_of(const Experiment& experiment) { return *experiment.at(0).body->robot; }

class EpisodeBatch {
 public:
  EpisodeBatch(std::shared_ptr<const Experiment> experiment, int n, DrivenBodies led)
      : experiment_(std::move(experiment)), led_(led) {
    require(n >= 1 && n <= 4096, "n: expected 1 to 4096 episodes, found {}", n);
    joints_ = robot().dof();
    numbers_ = 91 + 2 * joints_;
    for (int i = 0; i < n; ++i) episodes_.push_back(std::make_unique<SteppedEpisode>(experiment_, led));
    frames_.resize(static_cast<std::size_t>(n) * kHistoryFrames * numbers_);
    root_.resize(static_cast<std::size_t>(n) * 7);
    hold_.resize(static_cast<std::size_t>(n) * kAnchors * width());
    if (led_ == DrivenBodies::kBoth) partner_ahead_.resize(static_cast<std::size_t>(n) * kAhead);
    over_.assign(n, 1);
    success_.assign(n, 0);
    tick_.assign(n, 0);
    episode_.assign(n, -1);
  }

  [[nodiscard]] int size() const { return static_cast<int>(episodes_.size()); }
  [[nodiscard]] int joints() const { return joints_; }
  [[nodiscard]] int width() const { return 7 + joints_; }
  [[nodiscard]] bool leads_partner() const { return led_ == DrivenBodies::kBoth; }

  // Begins episode numbers[i] at place places[i]; all compute at once.
  void reset(const std::vector<int>& places, const std::vector<int>& numbers) {
    require(places.size() == numbers.size(), "reset: expected {} episodes, found {}", places.size(), numbers.size());
    for (const int place : places) check(place);
    for (std::size_t i = 0; i < places.size(); ++i) {
      episodes_[places[i]]->start(numbers[i]);
      episode_[places[i]] = numbers[i];
    }
    for (const int place : places) show(place, episodes_[place]->next());
  }

  // Answers every episode that is not over; rows of the others are not looked at. `partners`: as partner_ahead_, or
  // null.
  void step(const double* plans, int rows, const double* partners) {
    const std::size_t numbers = static_cast<std::size_t>(rows) * width();
    std::vector<int> led;
    for (int place = 0; place < size(); ++place)
      if (!episodes_[place]->is_over()) led.push_back(place);
    for (const int place : led)  // before any goes on: after a refusal every episode stands where it stood
      if (partners != nullptr) {
        const double* ahead = partners + static_cast<std::size_t>(place) * kAhead;
        episodes_[place]->lead_partner({kTicksPerPlan, kSmplJoints, std::vector<double>(ahead, ahead + kAhead)});
      }
    for (const int place : led) episodes_[place]->answer({plans + place * numbers, numbers}, rows);
    for (const int place : led) show(place, episodes_[place]->next());
  }

  [[nodiscard]] std::string row(int place) const {
    check(place);
    return episodes_[place]->row() ? dumped(to_json(*episodes_[place]->row())) : "";
  }

  void close() {
    for (const auto& episode : episodes_) episode->stop();
    over_.assign(over_.size(), 1);
  }

  static constexpr std::size_t kAhead = std::size_t{3} * kTicksPerPlan * kSmplJoints;
  std::vector<double> frames_, root_, hold_;  // (n, 12, numbers), (n, 7), (n, 5, 7 + joints)
  std::vector<double> partner_ahead_;         // (n, 10, 24, 3) where both are led, else empty
  std::vector<std::uint8_t> over_, success_;
  std::vector<std::int64_t> tick_, episode_;
  int numbers_ = 0;

 private:
  void check(int place) const {
    require(place >= 0 && place < size(), "episode: expected a place below {}, found {}", size(), place);
  }

  void show(int place, const std::shared_ptr<const PlanRequest>& request) {
    over_[place] = request == nullptr ? 1 : 0;
    success_[place] = 0;
    if (request == nullptr) {
      const auto& row = episodes_[place]->row();
      success_[place] = row && row->success.value_or(false) ? 1 : 0;
      return;
    }
    const std::size_t size = request->frames.size();
    std::copy(request->frames.data(), request->frames.data() + size, &frames_[place * size]);
    put(request->now, &root_[static_cast<std::size_t>(place) * 7]);
    for (int row = 0; row < kAnchors; ++row) {
      double* out = &hold_[(static_cast<std::size_t>(place) * kAnchors + row) * width()];
      put(request->standing, out);
      std::copy(robot().neutral.data(), robot().neutral.data() + joints_, out + 7);
    }
    tick_[place] = request->tick;
    if (!leads_partner()) return;
    const PointTracks ahead = episodes_[place]->partner_ahead();
    std::ranges::copy(ahead.data(), partner_ahead_.begin() + static_cast<std::ptrdiff_t>(place * kAhead));
  }

  static void put(const Pose& X, double* out) {
    for (const double value : {X.p.x(), X.p.y(), X.p.z(), X.R.w(), X.R.x(), X.R.y(), X.R.z()}) *out++ = value;
  }

  [[nodiscard]] const RobotModel& robot() const { return robot_of(*experiment_); }

  std::shared_ptr<const Experiment> experiment_;
  DrivenBodies led_;
  std::vector<std::unique_ptr<SteppedEpisode>> episodes_;
  int joints_ = 0;
};

// A part of each episode's newest frame.
py::array part_of(const py::object& self, const Part& part) {
  auto& batch = self.cast<EpisodeBatch&>();
  const py::ssize_t number = sizeof(double), frame = batch.numbers_ * number;
  const double* newest =
      batch.frames_.data() + static_cast<std::ptrdiff_t>(kHistoryFrames - 1) * batch.numbers_ + part.first;
  const py::ssize_t n = batch.size(), episode = kHistoryFrames * frame;
  if (std::string_view(part.name) == "partner")
    return view_of(newest, {n, kSmplJoints, 3}, {episode, 3 * number, number}, self);
  return view_of(newest, {n, part.size}, {episode, number}, self);
}

std::vector<Part> parts_of(int joints) {
  return {{"partner", 3, 3 * kSmplJoints},
          {"velocity", 75, 3},
          {"angular_velocity", 78, 3},
          {"gravity", 81, 3},
          {"q", 84, joints},
          {"v", 84 + joints, joints},
          {"offset", 84 + 2 * joints, 3},
          {"orientation", 87 + 2 * joints, 4}};
}

py::array named_view(const py::object& self, const std::string& name) {
  auto& batch = self.cast<EpisodeBatch&>();
  const py::ssize_t n = batch.size();
  if (name == "frames") return view_of(batch.frames_.data(), {n, kHistoryFrames, batch.numbers_}, self);
  if (name == "root") return view_of(batch.root_.data(), {n, 7}, self);
  if (name == "hold") return view_of(batch.hold_.data(), {n, kAnchors, batch.width()}, self);
  if (name == "partner_ahead" && batch.leads_partner())
    return view_of(batch.partner_ahead_.data(), {n, kTicksPerPlan, kSmplJoints, 3}, self);
  if (name == "over") return view_of(batch.over_.data(), {n}, self);
  if (name == "success") return view_of(batch.success_.data(), {n}, self);
  if (name == "tick") return view_of(batch.tick_.data(), {n}, self);
  if (name == "episode") return view_of(batch.episode_.data(), {n}, self);
  std::string known = "frames, root, hold, over, success, tick, episode";
  if (batch.leads_partner()) known += ", partner_ahead";
  for (const Part& part : parts_of(batch.joints())) {
    if (name == part.name) return part_of(self, part);
    known += std::string(", ") + part.name;
  }
  throw std::invalid_argument(fmt::format("view: expected one of {}, found '{}'", known, name));
}

void step_batch(EpisodeBatch& batch, const Numbers& plans, const std::optional<Numbers>& partners) {
  const bool fits = plans.ndim() == 3 && plans.shape(0) == batch.size() && plans.shape(2) == batch.width() &&
                    (plans.shape(1) == kAnchors || plans.shape(1) == kDensePlan);
  if (!fits) {
    const std::vector<py::ssize_t> shape(plans.shape(), plans.shape() + plans.ndim());
    throw std::invalid_argument(
        fmt::format("step: expected plans of shape ({0}, {1}, {3}) or ({0}, {2}, {3}), found ({4})", batch.size(),
                    kAnchors, kDensePlan, batch.width(), fmt::join(shape, ", ")));
  }
  if (partners) {
    if (!batch.leads_partner())
      throw std::invalid_argument("step: expected no partners: in this batch they follow their clips");
    const std::vector<py::ssize_t> shape(partners->shape(), partners->shape() + partners->ndim());
    if (shape != std::vector<py::ssize_t>{batch.size(), kTicksPerPlan, kSmplJoints, 3})
      throw std::invalid_argument(fmt::format("step: expected partners of shape ({}, {}, {}, 3), found ({})",
                                              batch.size(), kTicksPerPlan, kSmplJoints, fmt::join(shape, ", ")));
  }
  const double* data = plans.data();
  const double* ahead = partners ? partners->data() : nullptr;
  const auto rows = static_cast<int>(plans.shape(1));
  const py::gil_scoped_release released;
  batch.step(data, rows, ahead);
}

std::shared_ptr<Experiment> led_suite(const std::string& suite, const Overrides& overrides, const SteppedPart& part,
                                      int threads) {
  Progress quiet(Progress::Style::kQuiet);
  return stepped_experiment(load_suite(suite_file(suite), overrides), part, threads, quiet);
}

std::tuple<std::string, std::string, std::string> about_episode(const Experiment& experiment, int episode) {
  require(episode >= 0 && episode < experiment.size(), "episode: expected a number below {}, found {}",
          experiment.size(), episode);
  const PairedMotion& clip = *experiment.at(episode).clip;
  return {clip.clip_id, std::string(to_string(clip.task)), std::string(task_prompt(clip.task))};
}

int most_steps(const Experiment& experiment) {
  int most = 0;
  for (std::int64_t episode = 0; episode < experiment.size(); ++episode)
    most = std::max(most, questions_of(experiment, episode));
  return most;
}

std::vector<double> list_of(const Eigen::VectorXd& values) { return {values.begin(), values.end()}; }

}  // namespace

void add_environment(py::module_& module) {
  const auto released = py::call_guard<py::gil_scoped_release>();
  py::class_<Experiment, std::shared_ptr<Experiment>>(module, "EpisodeEnvironment", "What episodes are drawn from.")
      .def(py::init([](const std::string& suite, const Overrides& overrides, const std::string& engine,
                       const std::string& controller, const std::string& task, const std::string& perturbation,
                       int threads) {
             return led_suite(suite, overrides, {engine, controller, task, perturbation}, threads);
           }),
           py::arg("suite"), py::arg("overrides"), py::arg("engine"), py::arg("controller"), py::arg("task"),
           py::arg("perturbation"), py::arg("threads"), released)
      .def("__len__", &Experiment::size)
      .def("about", &about_episode, py::arg("episode"), "Its clip, task and prompt.")
      .def_property_readonly("most_steps", &most_steps, "That an episode of it has; looks at each.")
      .def_property_readonly("joints", [](const Experiment& suite) { return robot_of(suite).joint_names(); })
      .def_property_readonly("lower", [](const Experiment& suite) { return list_of(robot_of(suite).lower()); })
      .def_property_readonly("upper", [](const Experiment& suite) { return list_of(robot_of(suite).upper()); });
  py::class_<EpisodeBatch>(module, "EpisodeBatch", "Episodes that are led in step.")
      .def(py::init([](const std::shared_ptr<Experiment>& suite, int n, bool leads_partner) {
             return std::make_unique<EpisodeBatch>(suite, n,
                                                   leads_partner ? DrivenBodies::kBoth : DrivenBodies::kRobot);
           }),
           py::arg("suite"), py::arg("n"), py::arg("leads_partner") = false)
      .def("__len__", &EpisodeBatch::size)
      .def("reset", &EpisodeBatch::reset, py::arg("places"), py::arg("episodes"), released)
      .def("step", &step_batch, py::arg("plans"), py::arg("partners") = py::none())
      .def("view", &named_view, py::arg("name"), "A live view, read-only.")
      .def("row", &EpisodeBatch::row, py::arg("place"), "JSON; empty while the episode goes on.")
      .def("close", &EpisodeBatch::close, released);
}

// Questions of waiting episodes as arrays, and what a function of Python answers.

namespace {

using Requests = std::vector<std::shared_ptr<const PlanRequest>>;

// A batch: what B episodes ask.
struct Observations {
  Requests requests;
  std::shared_ptr<const RobotModel> robot;
  py::object frames = {};  // (B, frames, numbers), made once

  [[nodiscard]] py::ssize_t size() const { return static_cast<py::ssize_t>(requests.size()); }
};

py::array frames_of(Observations& batch) {
  if (!batch.frames) {
    const Eigen::MatrixXd& first = batch.requests.front()->frames;
    py::array_t<double> array(
        {batch.size(), static_cast<py::ssize_t>(first.cols()), static_cast<py::ssize_t>(first.rows())});
    double* out = array.mutable_data();
    for (const auto& request : batch.requests)
      out = std::copy(request->frames.data(), request->frames.data() + request->frames.size(), out);
    batch.frames = array;
  }
  return batch.frames;
}

template <typename T, typename Value>
py::array_t<T> each(const Observations& batch, const Value& value) {
  py::array_t<T> array(batch.size());
  for (py::ssize_t i = 0; i < batch.size(); ++i) array.mutable_at(i) = static_cast<T>(value(*batch.requests[i]));
  return array;
}

std::vector<std::string> texts(const Observations& batch, const std::function<std::string(const PlanRequest&)>& text) {
  std::vector<std::string> all;
  for (const auto& request : batch.requests) all.push_back(text(*request));
  return all;
}

// (B, 7): position and quaternion wxyz.
py::array_t<double> poses(const Observations& batch, const std::function<const Pose&(const PlanRequest&)>& pose) {
  py::array_t<double> array({batch.size(), py::ssize_t{7}});
  double* out = array.mutable_data();
  for (const auto& request : batch.requests) {
    const Pose& X = pose(*request);
    for (const double value : {X.p.x(), X.p.y(), X.p.z(), X.R.w(), X.R.x(), X.R.y(), X.R.z()}) *out++ = value;
  }
  return array;
}

// (B, 5, 7 + n): the null arm's plans.
py::array_t<double> holding(const Observations& batch) {
  const int width = 7 + batch.robot->dof();
  py::array_t<double> array({batch.size(), py::ssize_t{kAnchors}, static_cast<py::ssize_t>(width)});
  double* out = array.mutable_data();
  for (const auto& request : batch.requests)
    for (int row = 0; row < kAnchors; ++row) {
      const Pose& X = request->standing;
      for (const double value : {X.p.x(), X.p.y(), X.p.z(), X.R.w(), X.R.x(), X.R.y(), X.R.z()}) *out++ = value;
      out = std::copy(batch.robot->neutral.data(), batch.robot->neutral.data() + batch.robot->dof(), out);
    }
  return array;
}

void add_observations(py::module_& module) {
  py::class_<Observations>(module, "Observations",
                           "What the episodes that wait see; B of them, the first axis of every array.")
      .def("__len__", [](const Observations& batch) { return batch.requests.size(); })
      .def(
          "part",
          [](const Observations& batch, std::size_t i) {
            require(i < batch.requests.size(), "observations: expected a place below {}, found {}",
                    batch.requests.size(), i);
            return Observations{{batch.requests[i]}, batch.robot};
          },
          py::arg("i"), "The question of one episode, as a batch of one.")
      .def_property_readonly("frames", &frames_of,
                             "(B, 12, 149): the supplement's observation, oldest first, at 50 Hz.")
      .def_property_readonly(
          "episode",
          [](const Observations& b) { return each<std::int64_t>(b, [](const PlanRequest& r) { return r.episode; }); },
          "(B,): tells episodes under way apart.")
      .def_property_readonly(
          "tick",
          [](const Observations& b) { return each<std::int64_t>(b, [](const PlanRequest& r) { return r.tick; }); },
          "(B,): 50 Hz ticks since the episode's start.")
      .def_property_readonly(
          "first", [](const Observations& b) { return each<bool>(b, [](const PlanRequest& r) { return r.first; }); },
          "(B,): whether it is the episode's first question.")
      .def_property_readonly(
          "seed",
          [](const Observations& b) { return each<std::uint64_t>(b, [](const PlanRequest& r) { return r.seed; }); },
          "(B,): of the episode; random numbers that depend on it alone repeat.")
      .def_property_readonly("task",
                             [](const Observations& b) {
                               return texts(b, [](const PlanRequest& r) { return std::string(to_string(r.task)); });
                             })
      .def_property_readonly(
          "prompt", [](const Observations& b) { return texts(b, [](const PlanRequest& r) { return r.prompt; }); })
      .def_property_readonly(
          "start",
          [](const Observations& b) { return poses(b, [](const PlanRequest& r) -> const Pose& { return r.start; }); },
          "(B, 7): the root at the episode's start, position [m] and quaternion wxyz, world.")
      .def_property_readonly(
          "root",
          [](const Observations& b) { return poses(b, [](const PlanRequest& r) -> const Pose& { return r.now; }); },
          "(B, 7): the root now.")
      .def_property_readonly(
          "joints", [](const Observations& b) { return b.robot->joint_names(); }, "Names of the joints, in order.")
      .def_property_readonly(
          "neutral", [](const Observations& b) { return py::array_t<double>(b.robot->dof(), b.robot->neutral.data()); },
          "(29,): the neutral pose [rad].")
      .def("hold", &holding,
           "(B, 5, 36): plans that stand in the neutral pose where the episode began: the null policy.");
}

// Takes (B, 5 or 100, 7 + n) numbers, B plans.
void answer(PlanQueue& queue, const Observations& batch, const Numbers& plans) {
  const int width = 7 + batch.robot->dof();
  const bool fits = plans.ndim() == 3 && plans.shape(0) == batch.size() &&
                    (plans.shape(1) == kAnchors || plans.shape(1) == kDensePlan) && plans.shape(2) == width;
  if (!fits) {
    std::vector<py::ssize_t> shape(plans.shape(), plans.shape() + plans.ndim());
    throw std::invalid_argument(fmt::format("expected plans of shape ({0}, {1}, {3}) or ({0}, {2}, {3}), found ({4})",
                                            batch.size(), kAnchors, kDensePlan, width, fmt::join(shape, ", ")));
  }
  const double* data = plans.data();
  const auto rows = static_cast<int>(plans.shape(1));
  const py::gil_scoped_release released;
  for (const auto& request : batch.requests) {
    queue.answer(*request, {data, static_cast<std::size_t>(rows) * width}, rows);
    data += static_cast<std::ptrdiff_t>(rows) * width;
  }
}

}  // namespace

void add_plans(py::module_& module) {
  add_observations(module);
  py::class_<PlanQueue, std::shared_ptr<PlanQueue>>(module, "PlanQueue", "Episodes that wait for plans of a function.")
      .def(py::init([](const std::string& name, double patience, double share) {
             return PlanQueue::make({.name = name, .patience = patience, .share = share});
           }),
           py::arg("name"), py::arg("patience"), py::arg("share"))
      .def(
          "take",
          [](PlanQueue& queue, double seconds) -> std::optional<Observations> {
            Requests requests;
            {
              const py::gil_scoped_release released;
              requests = queue.take(seconds);
            }
            if (requests.empty()) return std::nullopt;
            return Observations{std::move(requests), queue.robot()};
          },
          py::arg("seconds"), "The episodes that wait; None: nobody did within so many seconds.")
      .def("answer", &answer, py::arg("observations"), py::arg("plans"))
      .def(
          "refuse",
          [](PlanQueue& queue, const Observations& batch, const std::string& why) {
            for (const auto& request : batch.requests) queue.refuse(*request, why);
          },
          py::arg("observations"), py::arg("why"), "The episodes end as errors with this sentence.")
      .def(
          "close", [](PlanQueue& queue, const std::string& why) { queue.close(why); }, py::arg("why"))
      .def_property_readonly("closed", &PlanQueue::closed);
}

}  // namespace duet::python
