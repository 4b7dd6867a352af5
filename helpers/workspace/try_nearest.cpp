#include <algorithm>
#include <iostream>
#include <string>
#include <scan_tools/nearest.hpp>

// Prints nearest(), and what min_element finds.
int main(int argc, char ** argv)
{
  if (argc < 4) {
    std::cerr << "usage: try_nearest RANGE_MIN RANGE_MAX RANGE..." << std::endl;
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
  std::cout << *std::min_element(scan.ranges.begin(), scan.ranges.end()) << std::endl;
}
