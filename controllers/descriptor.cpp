#include "duet/controllers/descriptor.h"

#include "duet/core/file.h"

namespace duet {
int Descriptor::actions() const {
  int count = 0;
  for (const DescriptorJoint& joint : joints) count += joint.action ? 1 : 0;
  return count;
}

int Descriptor::group_size(const ChannelGroup& group) const {
  int size = 0;
  for (const Channel& channel : group.channels) size += channel_size(channel, actions());
  return size;
}

int Descriptor::part_size(const InputPart& part) const {
  int size = 0;
  for (const int group : part.groups) size += group_size(groups[group]);
  return size;
}

std::vector<LayoutBlock> Descriptor::layout(const DescriptorInput& input) const {
  std::vector<LayoutBlock> blocks;
  for (const InputPart& part : input.parts) {
    LayoutBlock& block = blocks.emplace_back();
    block.frames = part.history.frames;
    for (const int group : part.groups)
      for (const Channel& channel : groups[group].channels)
        block.entries.push_back({to_string(channel.kind), channel_size(channel, actions())});
  }
  return blocks;
}

int Descriptor::input_size(const DescriptorInput& input) const { return layout_size(layout(input)); }

std::string Descriptor::input_layout(const DescriptorInput& input) const { return layout_text(layout(input)); }

Descriptor read_descriptor(const std::string& path) { return parse_descriptor(read_text(path), path); }

}  // namespace duet
