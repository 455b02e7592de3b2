#include "duet/io/observation.h"

#include <algorithm>

namespace duet {

int channels_size(std::span<const Channel> channels, const ChannelWidths& widths) {
  int size = 0;
  for (const Channel& channel : channels) size += channel_size(channel, widths);
  return size;
}

int ObservationLayout::part_size(const InputPart& part, const ChannelWidths& widths) const {
  int size = part.size;
  for (const int group : part.groups) size += channels_size(groups[group].channels, widths);
  return size;
}

std::vector<LayoutBlock> ObservationLayout::blocks(const ObservationInput& input, const ChannelWidths& widths,
                                                   ChannelFormat format) const {
  std::vector<LayoutBlock> blocks;
  for (const InputPart& part : input.parts) {
    LayoutBlock& block = blocks.emplace_back();
    block.frames = part.history.frames;
    if (!part.from.empty()) block.entries.push_back({part.from, part.size});
    for (const int group : part.groups)
      for (const Channel& channel : groups[group].channels)
        block.entries.push_back({channel_name(channel.kind, format), channel_size(channel, widths)});
  }
  return blocks;
}

int ObservationLayout::input_size(const ObservationInput& input, const ChannelWidths& widths) const {
  return layout_size(blocks(input, widths, ChannelFormat::kController));
}

ObservationWriter::ObservationWriter(const ObservationLayout& layout, const ChannelWidths& widths) {
  std::size_t longest = 0;
  for (const ChannelGroup& group : layout.groups)
    groups_.push_back({group.channels, std::vector<float>(channels_size(group.channels, widths))});
  for (const ObservationInput& input : layout.inputs) {
    Input& made = inputs_.emplace_back();
    made.values.resize(layout.input_size(input, widths));
    for (const InputPart& part : input.parts) {
      const int size = layout.part_size(part, widths);
      longest = std::max(longest, static_cast<std::size_t>(size));
      made.parts.push_back({part.groups, FrameHistory(size, part.history)});
    }
  }
  frame_.reserve(longest);
}

void ObservationWriter::reset() {
  for (Input& input : inputs_)
    for (Part& part : input.parts) part.history.reset();
}

void ObservationWriter::fill_inputs() {
  for (Input& input : inputs_) {
    std::span<float> rest = input.values;
    for (Part& part : input.parts) {
      frame_.clear();
      for (const int group : part.groups)
        frame_.insert(frame_.end(), groups_[group].values.begin(), groups_[group].values.end());
      const auto size = static_cast<std::size_t>(part.history.size());
      part.history.add(frame_, rest.first(size));
      rest = rest.subspan(size);
    }
  }
}

FrameHistory::FrameHistory(int frame_size, const HistoryRule& rule)
    : rule_(rule), frame_size_(frame_size), past_(static_cast<std::size_t>(frame_size) * rule.frames) {}

void FrameHistory::reset() {
  first_ = true;
  std::ranges::fill(past_, 0.0F);
}

void FrameHistory::add(std::span<const float> frame, std::span<float> out) {
  if (first_ && rule_.starts_full)
    for (int k = 0; k < rule_.frames; ++k) std::ranges::copy(frame, past_.begin() + k * frame_size_);
  first_ = false;
  if (!rule_.current) std::ranges::copy(past_, out.begin());
  std::copy(past_.begin() + frame_size_, past_.end(), past_.begin());
  std::ranges::copy(frame, past_.end() - frame_size_);
  if (rule_.current) std::ranges::copy(past_, out.begin());
}

}  // namespace duet
