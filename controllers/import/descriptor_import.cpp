#include "duet/controllers/import/descriptor_import.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/descriptor_controller.h"
#include "duet/controllers/import/draft.h"
#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

// Actions beyond this many radians at the default pose are said: networks that walk ask for a few tenths.
constexpr double kLargeAction = 1.0;

bool is_yaml(const std::string& file) { return file.ends_with(".yaml") || file.ends_with(".yml"); }

std::string plain(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_'; }, '_');
  return name.empty() || name == "_" ? "imported" : name;
}

std::string joined(const std::vector<std::string>& items) { return fmt::format("{}", fmt::join(items, ", ")); }

class Importer {
 public:
  explicit Importer(const ImportRequest& request) : request_(request) {}

  ImportedDescriptor run() {
    require(request_.history.empty() || request_.history == "frames" || request_.history == "terms",
            "history: expected frames or terms, found '{}'", request_.history);
    read();
    if (draft_.terms.empty())
      throw InputError(fmt::format("'{}': expected terms of an observation, found none", request_.file));
    const std::string& card = request_.robot.empty() ? draft_.card : request_.robot;
    body_ = body_of(names_of(draft_.joints), card, request_.file);
    made_.kind = draft_.kind;
    made_.robot = body_.card;
    made_.name = request_.name.empty() ? plain(fs::path(request_.file).stem().string()) : request_.name;
    if (network_) bind();
    made_.assumed.insert(made_.assumed.begin(), draft_.assumed.begin(), draft_.assumed.end());
    made_.assumed.emplace_back("licence: write it down; no such file says it");
    made_.text = text();
    check();
    return std::move(made_);
  }

 private:
  void read() {
    const bool is_deployment = is_yaml(request_.file);
    const std::string bytes = is_deployment ? read_data(request_.file) : "";
    if (!is_deployment) load(request_.network.empty() ? request_.file : request_.network);
    if (is_deployment && !request_.network.empty()) load(request_.network);
    if (!is_deployment) {
      draft_ = draft_of_metadata(network_->metadata, request_.file, request_.robot);
      return;
    }
    const YAML::Node document = parse_yaml(bytes, request_.file);
    const fs::path beside = fs::path(request_.file).parent_path() / "policy.onnx";
    if (!network_ && fs::exists(beside)) load(beside.string());
    draft_ = draft_of_deployment(document, request_.file, request_.robot, network_ ? network_->metadata : Metadata());
    const fs::path named = fs::path(request_.file).parent_path() / draft_.network;
    if (!network_ && !draft_.network.empty() && fs::exists(named)) load(named.string());
    if (!network_)
      made_.assumed.emplace_back("sizes fit: no network was found beside the file to compare (--network gives one)");
  }

  void load(const std::string& path) {
    network_ = load_network_file(path);
    made_.network = path;
    sample_ = network_->make();
  }

  // ---- the network's own sizes

  [[nodiscard]] int term_size(const DraftTerm& term) const {
    Descriptor one = parse_descriptor(text_of({term}, "  - parts: [{groups: [frame]}]\n"), request_.file);
    return one.input_size(one.observation.inputs[0]);
  }

  // Finds the input of the observation, the inputs beside it and the output of the action.
  void bind() {
    int frame = 0, shown = 0;
    std::vector<std::string> sizes;
    for (const DraftTerm& term : draft_.terms) {
      const int size = term_size(term);
      frame += size;
      shown += size * term.frames;
      sizes.push_back(fmt::format("{} {}", term.name, size));
    }
    const auto fits = [&](const Port& port) { return port.size == shown || (frame > 0 && port.size % frame == 0); };
    const auto input = std::ranges::find_if(sample_->inputs(), fits);
    if (input == sample_->inputs().end() || frame <= 1) refuse_sizes(sizes, shown);
    if (input->size != shown) take_history(*input, frame, shown, sizes);
    if (sample_->inputs().size() > 1) input_ = input->name;
    for (const Port& port : sample_->inputs())
      if (port.name != input->name) bind_other(port);
    std::vector<std::string> outputs;
    for (const Port& port : sample_->outputs())
      if (port.size == static_cast<int>(draft_.joints.size())) outputs.push_back(port.name);
    if (outputs.empty())
      throw InputError(fmt::format("'{}': expected an output of {} numbers, one for each joint, found {}",
                                   made_.network, draft_.joints.size(), ports(sample_->outputs())));
    const auto named = std::ranges::find_if(outputs, [](const std::string& n) { return n.find("action") != n.npos; });
    if (sample_->outputs().size() > 1) output_ = named == outputs.end() ? outputs.front() : *named;
  }

  static std::string ports(std::span<const Port> all) {
    std::vector<std::string> texts;
    for (const Port& port : all) texts.push_back(fmt::format("'{}' of {}", port.name, port.size));
    return joined(texts);
  }
  [[noreturn]] void refuse_sizes(const std::vector<std::string>& sizes, int shown) const {
    const bool all_larger = std::ranges::all_of(sample_->inputs(), [&](const Port& port) { return port.size > shown; });
    throw InputError(fmt::format("'{}': expected an input of {} numbers ({}), found {}{}", made_.network, shown,
                                 joined(sizes), ports(sample_->inputs()),
                                 all_larger ? ": the network sees more than the file lists; write the descriptor by "
                                              "hand (docs/extending.md, \"Enter the arena\")"
                                            : ""));
  }

  // The network takes whole frames, and the file says nothing of them.
  void take_history(const Port& input, int frame, int shown, const std::vector<std::string>& sizes) {
    const int frames = input.size / frame;
    if (shown != frame) refuse_sizes(sizes, shown);
    if (request_.history.empty())
      throw InputError(fmt::format(
          "'{}': input '{}' takes {} numbers, the terms are {}: a history of {} frames, whose order the file does not "
          "say; --history frames (frame by frame) or terms (term by term)",
          made_.network, input.name, input.size, frame, frames));
    for (DraftTerm& term : draft_.terms) term.frames = frames;
    draft_.frame_major = request_.history == "frames";
    draft_.assumed.push_back(fmt::format("the history of {} frames begins with zeros: the file does not say", frames));
  }

  void bind_other(const Port& port) {
    if (port.size == 1 && port.name.find("step") != std::string::npos) {
      others_ += fmt::format("  - {{name: {}, parts: [{{groups: [clock]}}]}}\n", port.name);
      has_tick_ = true;
      return;
    }
    // A memory: "h_in" and "h_out", "input_hidden_states" and "output_hidden_states".
    for (const auto& [in, out] : {std::pair{"in", "out"}, std::pair{"input", "output"}}) {
      std::string twin = port.name;
      if (const std::size_t at = twin.find(in); at != std::string::npos) twin.replace(at, std::string(in).size(), out);
      for (const Port& output : sample_->outputs())
        if (output.name == twin && output.name != port.name && output.size == port.size) {
          others_ += fmt::format("  - {{name: {}, state: {}}}\n", port.name, output.name);
          return;
        }
    }
    throw InputError(
        fmt::format("'{}': expected an observation, a time step or a memory as inputs, found also '{}' of {}",
                    made_.network, port.name, port.size));
  }

  // ---- the text

  [[nodiscard]] std::string from(const char* key) const {
    const auto found = draft_.from.find(key);
    return found == draft_.from.end() ? "" : fmt::format("  # from {}", found->second);
  }

  [[nodiscard]] std::string joints_text() const {
    std::string text = "joints:" + from("joints") + "\n";
    for (const DescriptorJoint& joint : draft_.joints) {
      text += fmt::format("  - {{name: {}, default: {:.9g}, kp: {:.9g}, kd: {:.9g}, action: {:.9g}", joint.name,
                          joint.neutral, joint.kp, joint.kd, *joint.action);
      if (joint.clip) text += fmt::format(", clip: [{:.9g}, {:.9g}]", joint.clip->lower, joint.clip->upper);
      text += "}\n";
    }
    std::string others;
    for (const RobotJoint& joint : body_.robot->joints)
      if (std::ranges::find(draft_.joints, joint.name, &DescriptorJoint::name) == draft_.joints.end())
        others += fmt::format("  - {{name: {}, kp: {:.9g}, kd: {:.9g}}}\n", joint.name, joint.kp, joint.kd);
    return others.empty() ? text
                          : fmt::format("{}\nother_joints:  # from the card of '{}'\n{}", text, body_.card, others);
  }

  [[nodiscard]] static std::string channels_text(const DraftTerm& term) {
    std::string text;
    for (const std::string& channel : term.channels)
      text += fmt::format("    - {{channel: {}}}  # {}\n", channel, term.name);
    return text;
  }

  // A descriptor of these terms in one group, as far as sizes need it.
  [[nodiscard]] std::string text_of(const std::vector<DraftTerm>& terms, const std::string& inputs) const {
    std::string channels;
    for (const DraftTerm& term : terms) channels += channels_text(term);
    return fmt::format(
        "name: x\nabout: x\nlicence: x\nrobot: x\nnetwork: x\nrate_hz: 50\n{}observation:\n  frame:\n{}inputs:\n{}{}",
        joints_text(), channels, inputs, command_text());
  }

  [[nodiscard]] bool by_terms() const {
    return !draft_.frame_major && std::ranges::any_of(draft_.terms, [](const DraftTerm& t) { return t.frames > 1; });
  }

  [[nodiscard]] std::string observation_text() const {
    std::string text = "observation:" + from("observation") + "\n";
    if (!by_terms()) text += "  frame:\n";
    for (std::size_t i = 0; i < draft_.terms.size(); ++i) {
      if (by_terms()) text += fmt::format("  term_{}:\n", i + 1);
      text += channels_text(draft_.terms[i]);
    }
    if (has_tick_) text += "  clock:\n    - {channel: tick}\n";
    std::string parts;
    const auto part = [&](const std::string& group, int frames) {
      parts += fmt::format(
          "      - {{groups: [{}]{}}}\n", group,
          frames == 1 ? "" : fmt::format(", frames: {}{}", frames, draft_.starts_full ? ", start: repeated" : ""));
    };
    if (!by_terms()) part("frame", draft_.terms.front().frames);
    for (std::size_t i = 0; by_terms() && i < draft_.terms.size(); ++i)
      part(fmt::format("term_{}", i + 1), draft_.terms[i].frames);
    text += "\ninputs:\n";
    return text + (input_.empty() ? "  - parts:\n" : fmt::format("  - name: {}\n    parts:\n", input_)) + parts +
           others_;
  }

  [[nodiscard]] std::string command_text() const {
    if (!draft_.command) return "";
    const VelocityInterface& command = *draft_.command;
    std::string text = "\ncommand:" + from("command") + "\n";
    const auto range = [&](const char* name, const CommandRange& range) {
      text += fmt::format("  {}: {{limits: [{:.9g}, {:.9g}]{}}}\n", name, range.lower, range.upper,
                          range.steps_from > 0.0 ? fmt::format(", steps_from: {:.9g}", range.steps_from) : "");
    };
    range("forward", command.forward);
    range("lateral", command.lateral);
    range("yaw", command.yaw);
    if (command.stands_below)
      text += fmt::format("  stands_below: {{speed: {:.9g}, yaw_rate: {:.9g}}}\n", command.stands_below->speed,
                          command.stands_below->yaw_rate);
    return text;
  }

  [[nodiscard]] std::string network_text() const {
    if (made_.network.empty()) return draft_.network.empty() ? "policy.onnx" : draft_.network;
    const fs::path network(made_.network);
    if (request_.folder.empty()) return network.filename().string();
    return fs::absolute(network)
        .lexically_normal()
        .lexically_proximate(fs::absolute(request_.folder).lexically_normal())
        .string();
  }

  [[nodiscard]] std::string text() const {
    std::string text = fmt::format("# Imported from {} (a file of {}).\n# Assumed, because the file does not say:\n",
                                   fs::path(request_.file).filename().string(), draft_.kind);
    for (const std::string& sentence : made_.assumed) text += fmt::format("#   - {}\n", sentence);
    text += fmt::format(
        "# Every key: docs/file-formats.md, \"IO descriptor\".\nname: {}\nabout: 'imported from {}'\nlicence: "
        "unknown\nrobot: {}\n"
        "network: {}\nrate_hz: {:.9g}{}\n{}\n",
        made_.name, fs::path(request_.file).filename().string(), body_.card, network_text(), draft_.rate_hz,
        from("rate_hz"), draft_.command ? "walks: true\n" : "");
    if (draft_.dt) text += fmt::format("own_physics: {{dt: {:.9g}}}{}\n\n", *draft_.dt, from("own_physics"));
    text += joints_text() + "\n" + observation_text();
    std::vector<std::string> action;
    if (!output_.empty()) action.push_back("output: " + output_);
    if (draft_.action_clip < std::numeric_limits<double>::infinity())
      action.push_back(fmt::format("clip: {:.9g}", draft_.action_clip));
    if (!action.empty()) text += fmt::format("\naction: {{{}}}{}\n", joined(action), from("action"));
    return text + command_text();
  }

  // ---- what comes of it

  // The descriptor is read as any other; with its network it acts once, where it stands at its default pose.
  void check() {
    const Descriptor descriptor = parse_descriptor(made_.text, made_.name + ".yaml");
    if (!network_) return;
    for (const std::string& note : compare_with_network(descriptor, network_->metadata, made_.network))
      made_.found.push_back(note);
    ControllerOptions options;
    if (descriptor.command) options["command"] = "0,0,0";
    const auto controller =
        make_descriptor_controller(descriptor, body_.robot, network_->make(), made_.network, options);
    RobotState state = body_.robot->standing_state();
    for (const DescriptorJoint& joint : descriptor.joints)
      state.q[body_.robot->joint_index(joint.name)] = joint.neutral;
    JointCommand command = body_.robot->default_command(state.q);
    controller->reset(state);
    controller->act(state, {state.X_WB, state.q}, command);
    if (!command.q_target.allFinite())
      throw InputError(
          fmt::format("'{}': expected finite actions at the default pose, found some that are not", made_.network));
    Eigen::Index joint = 0;
    const double largest = (command.q_target - state.q).cwiseAbs().maxCoeff(&joint);
    made_.found.push_back(
        fmt::format("at its default pose, at rest, it moves the target of {} by {:.2f} rad and of others less{}",
                    body_.robot->joints[joint].name, command.q_target[joint] - state.q[joint],
                    largest > kLargeAction ? ": more than networks that walk ask for; look at scales and order" : ""));
  }

  const ImportRequest& request_;
  Draft draft_;
  DraftBody body_;
  std::optional<NetworkFile> network_;
  std::unique_ptr<Network> sample_;  // for its ports
  std::string input_, output_, others_;
  bool has_tick_ = false;
  ImportedDescriptor made_;
};

}  // namespace

ImportedDescriptor import_descriptor(const ImportRequest& request) { return Importer(request).run(); }

}  // namespace duet
