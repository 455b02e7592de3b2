// A network with each of its inputs bound to numbers that somebody keeps, or to one of its own outputs of the
// evaluation before. Nothing allocates after the last binding. One owner, not thread-safe.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/nn/network.h"

namespace duet {

// How a network's input is made up of named numbers: what messages say where the sum is not the network's.

struct LayoutEntry {
  std::string name;  // of a channel
  int size = 0;      // numbers that it shows
};

// Entries side by side, and so many frames of them one after another.
struct LayoutBlock {
  std::vector<LayoutEntry> entries;
  int frames = 1;

  [[nodiscard]] int frame_size() const;
};

int layout_size(const std::vector<LayoutBlock>& blocks);

// "command_velocity 0..2, command_height 3 (6 frames of 4); tick 24": places in the input's first frame of each block.
std::string layout_text(const std::vector<LayoutBlock>& blocks);

class BoundNetwork {
 public:
  // `descriptor`: the file that says what is bound; it and `path`, the network's file, stand in messages.
  BoundNetwork(std::unique_ptr<Network> network, std::string descriptor, std::string path);

  // Each throws InputError ("DESCRIPTOR:LINE: with PATH: ...") for a name that the network lacks (with the nearest and
  // all known), a size that is not its own (with the layout) and an input that is bound already. `name`: "" is the only
  // one.
  void bind_input(const std::string& name, int line, std::span<const float> values,
                  const std::vector<LayoutBlock>& layout);  // borrowed
  void bind_state(const std::string& name, int line, const std::string& output);
  [[nodiscard]] int find_output(const std::string& name, int line) const;
  // Throws InputError for an input that is bound to nothing.
  void require_all_bound() const;

  [[nodiscard]] std::span<const Port> outputs() const { return network_->outputs(); }
  [[nodiscard]] std::span<const float> output(int index) const { return values_[index]; }  // of the last run
  // "DESCRIPTOR:LINE: with PATH": what messages begin with.
  [[nodiscard]] std::string place(int line) const;

  void run();
  void reset();  // clears the network's memory and all states

 private:
  struct State {
    int output = 0;
    std::vector<float> values;
  };
  [[nodiscard]] int open_input(const std::string& name, int line) const;

  std::unique_ptr<Network> network_;
  std::string descriptor_, path_;
  std::vector<std::span<const float>> inputs_;  // in the network's order
  std::vector<std::vector<float>> values_;      // of the outputs
  std::vector<std::span<float>> outputs_;
  std::vector<State> states_;
};

}  // namespace duet
