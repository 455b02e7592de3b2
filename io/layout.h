// How a network's input is made up of named numbers: what messages say where the sum is not the network's.
#pragma once

#include <string>
#include <vector>

namespace duet {

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

}  // namespace duet
