#include "duet/io/bound_network.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

std::vector<std::string> port_names(std::span<const Port> ports) { return names_of(ports); }

// Index of the port that a descriptor means; "" is the only one.
int find_port(std::span<const Port> ports, const std::string& name, const char* what, const std::string& place) {
  if (name.empty() && ports.size() == 1) return 0;
  for (std::size_t i = 0; i < ports.size(); ++i)
    if (ports[i].name == name) return static_cast<int>(i);
  throw InputError(fmt::format("{}: {}", place,
                               name.empty()
                                   ? fmt::format("expected the name of one of the network's {}s ({}), found none", what,
                                                 fmt::join(port_names(ports), ", "))
                                   : unknown_name_message(what, name, port_names(ports))));
}

}  // namespace

BoundNetwork::BoundNetwork(std::unique_ptr<Network> network, std::string descriptor, std::string path)
    : network_(std::move(network)),
      descriptor_(std::move(descriptor)),
      path_(std::move(path)),
      inputs_(network_->inputs().size()) {
  for (const Port& port : network_->outputs()) values_.emplace_back(port.size);
  outputs_.assign(values_.begin(), values_.end());
}

std::string BoundNetwork::place(int line) const { return fmt::format("{}:{}: with {}", descriptor_, line, path_); }

int BoundNetwork::open_input(const std::string& name, int line) const {
  const int port = find_port(network_->inputs(), name, "input", place(line));
  if (inputs_[port].data() != nullptr)
    throw InputError(
        fmt::format("{}: expected each input once, found '{}' again", place(line), network_->inputs()[port].name));
  return port;
}

void BoundNetwork::bind_input(const std::string& name, int line, std::span<const float> values,
                              const std::vector<LayoutBlock>& layout) {
  const int port = open_input(name, line);
  const Port& input = network_->inputs()[port];
  if (static_cast<int>(values.size()) != input.size)
    throw InputError(fmt::format("{}: input '{}': expected {} numbers, found {} of the channels: {}", place(line),
                                 input.name, input.size, values.size(), layout_text(layout)));
  inputs_[port] = values;
}

void BoundNetwork::bind_state(const std::string& name, int line, const std::string& output) {
  const int port = open_input(name, line), from = find_output(output, line);
  const Port& input = network_->inputs()[port];
  if (outputs()[from].size != input.size)
    throw InputError(fmt::format("{}: input '{}': expected {} numbers, found {} of the output '{}'", place(line),
                                 input.name, input.size, outputs()[from].size, output));
  states_.push_back({from, std::vector<float>(static_cast<std::size_t>(input.size))});
  inputs_[port] = states_.back().values;
}

int BoundNetwork::find_output(const std::string& name, int line) const {
  return find_port(network_->outputs(), name, "output", place(line));
}

void BoundNetwork::require_all_bound() const {
  for (std::size_t port = 0; port < inputs_.size(); ++port)
    if (inputs_[port].data() == nullptr)
      throw InputError(fmt::format("{}: with {}: expected every input of the network in 'inputs', found none for '{}'",
                                   descriptor_, path_, network_->inputs()[port].name));
}

void BoundNetwork::run() {
  network_->run(inputs_, outputs_);
  for (State& state : states_) std::ranges::copy(values_[state.output], state.values.begin());
}

void BoundNetwork::reset() {
  network_->reset();
  for (State& state : states_) std::ranges::fill(state.values, 0.0F);
}

namespace {

std::string entry_text(const LayoutEntry& entry, int first) {
  if (entry.size == 1) return fmt::format("{} {}", entry.name, first);
  return fmt::format("{} {}..{}", entry.name, first, first + entry.size - 1);
}

std::string block_text(const LayoutBlock& block, int first) {
  std::string text;
  for (const LayoutEntry& entry : block.entries) {
    if (!text.empty()) text += ", ";
    text += entry_text(entry, first);
    first += entry.size;
  }
  if (block.frames > 1) text += fmt::format(" ({} frames of {})", block.frames, block.frame_size());
  return text;
}

}  // namespace

int LayoutBlock::frame_size() const {
  int size = 0;
  for (const LayoutEntry& entry : entries) size += entry.size;
  return size;
}

int layout_size(const std::vector<LayoutBlock>& blocks) {
  int size = 0;
  for (const LayoutBlock& block : blocks) size += block.frames * block.frame_size();
  return size;
}

std::string layout_text(const std::vector<LayoutBlock>& blocks) {
  std::string text;
  int first = 0;
  for (const LayoutBlock& block : blocks) {
    if (!text.empty()) text += "; ";
    text += block_text(block, first);
    first += block.frames * block.frame_size();
  }
  return text;
}

}  // namespace duet
