// Prints the folders of shipped files, a line each: a test runs copies of it in other places.
#include <cstdio>

#include "duet/core/share.h"

int main() {
  for (const std::string& folder : duet::share_folders()) std::printf("folder %s\n", folder.c_str());
}
