// Questions of waiting episodes as arrays, and what a function of Python answers.
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <string>
#include <utility>

#include "duet/core/require.h"
#include "duet/policies/plan_queue.h"
#include "duet/python/bindings.h"

namespace duet::python {
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
