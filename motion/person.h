// The two people of a clip.
#pragma once

namespace duet {

enum class Person { kA, kB };

}  // namespace duet
