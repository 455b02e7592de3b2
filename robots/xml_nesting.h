// How deep an XML text nests, told before a parser sees it: TinyXML goes down by recursion, so that a file that nests
// without end would end the program. Thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace duet {

// A URDF nests 5 deep, with the extensions of simulators about 10.
inline constexpr int kMostXmlDepth = 100;

// Throws InputError with file and line for elements that nest deeper than kMostXmlDepth, for a tag or comment without
// its end and for a '<' inside of a tag (which XML forbids, and which could hide an element from this count).
void check_xml_nesting(std::string_view text, const std::string& file);

}  // namespace duet
