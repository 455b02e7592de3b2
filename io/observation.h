// How channels make up what a network is shown: side by side in groups, groups now or over the last frames in parts,
// parts one after another in an input. One owner, not thread-safe; nothing allocates after construction.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "duet/io/bound_network.h"
#include "duet/io/channel.h"

namespace duet {

// The last frames of numbers that a network is shown, oldest first. Histories of whole frames (frame-major) are one of
// these; histories of each term by itself (term-major) are one for each. Nothing allocates after construction.

struct HistoryRule {
  int frames = 1;            // the current one counted where it is among them
  bool current = true;       // whether the current frame is the last of them
  bool starts_full = false;  // before the first frame: that frame repeated, else zeros
};

class FrameHistory {
 public:
  FrameHistory(int frame_size, const HistoryRule& rule);

  [[nodiscard]] int size() const { return static_cast<int>(past_.size()); }  // of all that is shown
  void reset();
  // Takes a frame and writes what is shown with it: `out` has size() numbers.
  void add(std::span<const float> frame, std::span<float> out);

 private:
  HistoryRule rule_;
  int frame_size_;
  bool first_ = true;
  std::vector<float> past_;  // oldest first
};

struct ChannelGroup {
  std::string name;
  int line = 0;
  std::vector<Channel> channels;
};

// Groups side by side, now or over the last frames (oldest first).
struct InputPart {
  int line = 0;
  std::vector<int> groups;
  HistoryRule history{};
  std::string from{};  // output of a network in the place of groups; its numbers are 0 here
  int size = 0;        // of that output
};

struct ObservationInput {
  std::string name;  // of the network's input; "" for its only one
  int line = 0;
  std::vector<InputPart> parts;  // none where it is a state
  std::string state;             // the output of the tick before that it is given, zeros at the start; "" otherwise
};

struct ObservationLayout {
  std::vector<ChannelGroup> groups = {};
  std::vector<ObservationInput> inputs = {};

  [[nodiscard]] int part_size(const InputPart& part, const ChannelWidths& widths) const;  // of one frame
  [[nodiscard]] int input_size(const ObservationInput& input, const ChannelWidths& widths) const;
  // `format`: whose names the channels have.
  [[nodiscard]] std::vector<LayoutBlock> blocks(const ObservationInput& input, const ChannelWidths& widths,
                                                ChannelFormat format) const;
};

int channels_size(std::span<const Channel> channels, const ChannelWidths& widths);

// Takes the numbers of channels one after another, scales and bounds them, and keeps them as float.
class ChannelWriter {
 public:
  explicit ChannelWriter(std::span<float> out) : out_(out) {}
  // Begins a channel: the numbers that follow get its scale and its clip. Before the first: as they are.
  void begin(const Channel& channel) {
    scale_ = channel.scale;
    clip_ = channel.clip;
    plain_ = scale_.size() == 1 && scale_[0] == 1.0 && clip_ == std::numeric_limits<double>::infinity();
    first_ = written_;
  }
  void operator()(double value) {
    claim(1);
    put(value);
  }
  template <typename Derived>
  void operator()(const Eigen::DenseBase<Derived>& values) {
    claim(static_cast<std::size_t>(values.size()));
    for (Eigen::Index i = 0; i < values.size(); ++i) put(static_cast<double>(values.derived().coeff(i)));
  }
  [[nodiscard]] bool is_full() const { return written_ == out_.size(); }

 private:
  void claim(std::size_t count) const {
    if (written_ + count > out_.size()) throw std::logic_error("observation: a channel shows more than its size");
  }
  void put(double value) {
    if (!plain_) value = std::clamp(value * scale_[scale_.size() == 1 ? 0 : written_ - first_], -clip_, clip_);
    out_[written_++] = static_cast<float>(value);
  }

  std::span<float> out_;
  std::span<const double> scale_;
  double clip_ = 0.0;
  bool plain_ = true;
  std::size_t written_ = 0, first_ = 0;
};

// `show(channel, writer)` gives the numbers of each channel; `out` has channels_size of them.
template <typename Show>
void write_channels(std::span<const Channel> channels, const Show& show, std::span<float> out) {
  ChannelWriter writer(out);
  for (const Channel& channel : channels) {
    writer.begin(channel);
    show(channel, writer);
  }
  if (!writer.is_full()) throw std::logic_error("observation: a channel shows less than its size");
}

// The inputs of a layout, tick by tick.
class ObservationWriter {
 public:
  ObservationWriter(const ObservationLayout& layout, const ChannelWidths& widths);

  void reset();
  // Calls write_channels for every group; then histories go on by a frame.
  template <typename Show>
  void update(const Show& show) {
    for (Group& group : groups_) write_channels(group.channels, show, group.values);
    fill_inputs();
  }
  // Numbers of the input in the order of ObservationLayout::inputs, after the last update.
  [[nodiscard]] std::span<const float> input(int index) const { return inputs_[index].values; }

 private:
  struct Group {
    std::vector<Channel> channels;
    std::vector<float> values;
  };
  struct Part {
    std::vector<int> groups;
    FrameHistory history;
  };
  struct Input {
    std::vector<Part> parts;
    std::vector<float> values;
  };
  void fill_inputs();

  std::vector<Group> groups_;
  std::vector<Input> inputs_;
  std::vector<float> frame_;  // one frame of a part
};

}  // namespace duet
