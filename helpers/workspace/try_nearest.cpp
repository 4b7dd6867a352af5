#define _GLIBCXX_ASSERTIONS  // an empty optional that is read ends the program
#include <algorithm>
#include <iostream>
#include <string>
#include <scan_tools/nearest.hpp>

// Prints nearest(), and what min_element finds.
int main(int argc, char ** argv)
{
  if (argc < 3) {
    std::cerr << "usage: try_nearest RANGE_MIN RANGE_MAX [RANGE...]" << std::endl;
    return 2;
  }
  sensor_msgs::msg::LaserScan scan;
  scan.range_min = std::stof(argv[1]);
  scan.range_max = std::stof(argv[2]);
  for (int i = 3; i < argc; ++i) {
    scan.ranges.push_back(std::stof(argv[i]));
  }
  const auto found = scan_tools::nearest(scan);
  std::cout << (found ? std::to_string(*found) : "nothing") << std::endl;
  const auto least = std::min_element(scan.ranges.begin(), scan.ranges.end());
  std::cout << (least != scan.ranges.end() ? std::to_string(*least) : "nothing") << std::endl;
}
