#include "duet/retarget/options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cmath>
#include <utility>
#include <variant>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

namespace {

using Field =
    std::variant<double*, int*, bool*, std::string*, PairMode*, Optimizer*, KinLoss*, ContactReduction*, ContactBlocks*,
                 RootTranslation*, ContactKeypoints*, std::vector<ContactKeypoint>*, KernelKind*>;

std::vector<std::pair<std::string, Field>> fields(PairOptions& o) {
  return {{"mode", &o.mode},
          {"w-kin", &o.weights.kin},
          {"w-con", &o.weights.con},
          {"w-hum", &o.weights.hum},
          {"w-temp", &o.weights.temp},
          {"w-acceleration", &o.weights.acceleration},
          {"w-pose", &o.weights.pose},
          {"w-bone", &o.weights.bone},
          {"w-partner", &o.weights.partner},
          {"w-collision", &o.weights.collision},
          {"w-object", &o.weights.object},
          {"stage1-iterations", &o.schedule.stage1_iterations},
          {"stage1-rate", &o.schedule.stage1_rate},
          {"stage2-iterations", &o.schedule.stage2_iterations},
          {"stage2-rate", &o.schedule.stage2_rate},
          {"stage2-contact-scale", &o.schedule.stage2_contact_scale},
          {"keep-moments", &o.schedule.keep_moments},
          {"adam-epsilon", &o.schedule.epsilon},
          {"kin-loss", &o.kin_loss},
          {"contact-reduction", &o.contact_reduction},
          {"contact-blocks", &o.contact_blocks},
          {"root", &o.root_translation},
          {"keypoints", &o.keypoints},
          {"keypoint-list", &o.keypoint_list},
          {"filter", &o.filter},
          {"adapt-human", &o.adapt_human},
          {"kernel", &o.kernel},
          {"optimizer", &o.optimizer},
          {"lbfgs-iterations", &o.lbfgs_iterations},
          {"ground", &o.ground},
          {"root-smoothing", &o.root_smoothing},
          {"smpl", &o.smpl_path}};
}

// The texts of an enumeration's values, in the order of its enumerators.
std::vector<std::string> texts(PairMode) { return {"paper", "grounded", "best"}; }
std::vector<std::string> texts(Optimizer) { return {"adam", "lbfgs"}; }
std::vector<std::string> texts(KinLoss) { return {"squared", "mean-norm"}; }
std::vector<std::string> texts(ContactReduction) { return {"frobenius", "mean"}; }
std::vector<std::string> texts(ContactBlocks) { return {"full", "cross-and-human", "cross"}; }
std::vector<std::string> texts(RootTranslation) { return {"constant-offset", "per-frame", "fixed"}; }
std::vector<std::string> texts(ContactKeypoints) { return {"nine", "eleven", "seven"}; }
std::vector<std::string> texts(KernelKind) { return {"auto", "scalar", "v2", "v3", "v4"}; }
std::vector<std::string> texts(bool) { return {"off", "on"}; }

[[noreturn]] void refuse(const std::string& name, const std::string& value, const std::string& expected) {
  throw std::invalid_argument(fmt::format("pair option '{}' has no value '{}': {}", name, value, expected));
}

template <typename Value>
void parse(Value& out, const std::string& name, const std::string& value) {
  const std::vector<std::string> known = texts(out);
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] != value) continue;
    out = static_cast<Value>(i);
    return;
  }
  refuse(name, value, fmt::format("{}", fmt::join(known, ", ")));
}

template <typename Number>
bool parse_number(Number& out, const std::string& value) {
  const char* end = value.data() + value.size();
  const auto [stop, error] = std::from_chars(value.data(), end, out);
  return error == std::errc() && stop == end;
}

void parse(double& out, const std::string& name, const std::string& value) {
  double number = 0.0;
  if (!parse_number(number, value) || !std::isfinite(number) || number < 0.0) {
    refuse(name, value, "a finite number, zero or more");
  }
  out = number;
}

void parse(int& out, const std::string& name, const std::string& value) {
  int number = 0;
  if (!parse_number(number, value) || number < 0) refuse(name, value, "a whole number, zero or more");
  out = number;
}

void parse(std::string& out, const std::string&, const std::string& value) { out = value; }

void parse(std::vector<ContactKeypoint>& out, const std::string& name, const std::string& value) {
  try {
    out = parse_contact_keypoints(value);
  } catch (const std::invalid_argument& error) {
    refuse(name, value, error.what());
  }
}

template <typename Value>
std::string format_value(Value value) {
  return texts(value)[static_cast<std::size_t>(value)];
}
std::string format_value(double value) { return fmt::format("{}", value); }
std::string format_value(int value) { return fmt::format("{}", value); }
std::string format_value(const std::string& value) { return value; }
std::string format_value(const std::vector<ContactKeypoint>& value) { return format_contact_keypoints(value); }

Field find_field(PairOptions& options, const std::string& name) {
  for (const auto& [known, field] : fields(options)) {
    if (known == name) return field;
  }
  throw std::invalid_argument(unknown_name_message("pair option", name, pair_option_names()));
}

}  // namespace

std::vector<std::string> pair_option_names() {
  PairOptions options;
  std::vector<std::string> names;
  for (const auto& [name, field] : fields(options)) names.push_back(name);
  return names;
}

PairOptions pair_options_of(PairMode mode) {
  PairOptions options;
  options.mode = mode;
  if (mode == PairMode::kPaper) return options;
  options.ground = true;
  options.contact_blocks = ContactBlocks::kCrossAndHuman;
  options.weights.bone = 5.0;
  options.weights.partner = 0.2;
  options.weights.collision = 10.0;
  if (mode != PairMode::kBest) return options;
  options.optimizer = Optimizer::kLbfgs;
  options.lbfgs_iterations = 60;
  return options;
}

PairOptions make_pair_options(const std::vector<std::pair<std::string, std::string>>& choices) {
  PairOptions options;
  for (const bool mode : {true, false}) {
    for (const auto& [name, value] : choices)
      if ((name == "mode") == mode) set_pair_option(options, name, value);
  }
  return options;
}

void set_pair_option(PairOptions& options, const std::string& name, const std::string& value) {
  if (name == "mode") {
    PairMode mode = PairMode::kPaper;
    parse(mode, name, value);
    options = pair_options_of(mode);
    return;
  }
  std::visit([&](auto* field) { parse(*field, name, value); }, find_field(options, name));
}

std::string pair_option(const PairOptions& options, const std::string& name) {
  PairOptions copy = options;
  return std::visit([](const auto* field) { return format_value(*field); }, find_field(copy, name));
}

void validate(const PairOptions& options) {
  for (const std::string& name : pair_option_names()) {
    PairOptions copy;
    set_pair_option(copy, name, pair_option(options, name));
  }
  require(
      !options.ground || options.root_translation != RootTranslation::kPerFrame,
      "pair options: root=per-frame would lift a robot that stands on the ground; expected constant-offset or fixed");
  require(options.optimizer == Optimizer::kAdam || options.lbfgs_iterations > 0,
          "pair options: lbfgs-iterations is 0; expected at least one iteration");
  require(options.schedule.stage1_iterations + options.schedule.stage2_iterations > 0,
          "pair options: stage1-iterations and stage2-iterations are both 0; expected at least one iteration");
}

}  // namespace duet
