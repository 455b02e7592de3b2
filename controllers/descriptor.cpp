#include "duet/controllers/descriptor.h"

#include "duet/core/file.h"

namespace duet {
int Descriptor::actions() const {
  int count = 0;
  for (const DescriptorJoint& joint : joints) count += joint.action ? 1 : 0;
  return count;
}

std::vector<LayoutBlock> Descriptor::layout(const ObservationInput& input) const {
  return observation.blocks(input, widths(), ChannelFormat::kController);
}

int Descriptor::input_size(const ObservationInput& input) const { return observation.input_size(input, widths()); }

std::string Descriptor::input_layout(const ObservationInput& input) const { return layout_text(layout(input)); }

Descriptor read_descriptor(const std::string& path) { return parse_descriptor(read_text(path), path); }

}  // namespace duet
