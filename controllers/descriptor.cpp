#include "controllers/descriptor.h"

#include <fmt/format.h>

#include "core/file.h"

namespace duet {
namespace {

std::string channel_place(const Channel& channel, int first, int size) {
  if (size == 1) return fmt::format("{} {}", to_string(channel.kind), first);
  return fmt::format("{} {}..{}", to_string(channel.kind), first, first + size - 1);
}

}  // namespace

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

int Descriptor::input_size(const DescriptorInput& input) const {
  int size = 0;
  for (const InputPart& part : input.parts) size += part.frames * part_size(part);
  return size;
}

std::string Descriptor::input_layout(const DescriptorInput& input) const {
  std::string text;
  int first = 0;
  for (const InputPart& part : input.parts) {
    if (!text.empty()) text += "; ";
    int place = first;
    const char* comma = "";
    for (const int group : part.groups)
      for (const Channel& channel : groups[group].channels) {
        const int size = channel_size(channel, actions());
        text += comma;
        text += channel_place(channel, place, size);
        place += size;
        comma = ", ";
      }
    if (part.frames > 1) text += fmt::format(" ({} frames of {})", part.frames, part_size(part));
    first += part.frames * part_size(part);
  }
  return text;
}

Descriptor read_descriptor(const std::string& path) { return parse_descriptor(read_text(path), path); }

}  // namespace duet
