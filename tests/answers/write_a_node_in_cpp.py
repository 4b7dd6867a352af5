"""Answers to the tasks of lesson 13, as students give them."""

NEAREST = """%%write src/scan_tools/include/scan_tools/nearest.hpp
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <sensor_msgs/msg/laser_scan.hpp>

namespace scan_tools
{

inline float nearest(const sensor_msgs::msg::LaserScan & scan)
{
  float found = std::numeric_limits<float>::infinity();
  LINES
  return found;
}

}  // namespace scan_tools
"""
WATCHER_CMAKE = """%%write src/watcher/CMakeLists.txt
cmake_minimum_required(VERSION 3.8)
project(watcher)

find_package(ament_cmake REQUIRED)
LINES

ament_package()
"""
FOUND = """find_package(scan_tools REQUIRED)
find_package(small_rclcpp REQUIRED)
find_package(std_msgs REQUIRED)
add_executable(watcher src/watcher.cpp)
"""
LINKED = """target_link_libraries(watcher PRIVATE
  scan_tools::scan_tools small_rclcpp::small_rclcpp ${std_msgs_TARGETS})
"""
INSTALLED = 'install(TARGETS watcher DESTINATION lib/${PROJECT_NAME})\n'
BRAKE = """%%write src/brake/src/brake.cpp
#include <geometry_msgs/msg/twist.hpp>
#include <scan_tools/nearest.hpp>
#include <small_rclcpp/small_rclcpp.hpp>
namespace ros = small_rclcpp;
using geometry_msgs::msg::Twist;
using sensor_msgs::msg::LaserScan;

class Brake : public ros::Node
{
public:
  Brake()
  : Node("brake")
  {
    publisher_ = create_publisher<Twist>("cmd_vel", 10);
    subscription_ = create_subscription<LaserScan>("scan", 1,
      [this](const LaserScan & scan) {
        const float distance = scan_tools::nearest(scan);
        Twist twist;
        LINES
      });
  }

private:
  ros::Publisher<Twist>::SharedPtr publisher_;
  ros::Subscription<LaserScan>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  ros::init(argc, argv);
  ros::spin(std::make_shared<Brake>());
  ros::shutdown();
}
"""
GOOD = 'twist.linear.x = distance < 0.4 ? 0.0 : distance < 0.7 ? 0.2 : 0.5;'
SPIN = """%%write src/brake/src/my_spin.hpp
#pragma once

#include <small_rclcpp/small_rclcpp.hpp>

inline void my_spin(const small_rclcpp::Node::SharedPtr & node)
{
LINES
}
"""


def with_lines(text: str, lines: str) -> str:
    """Return the text with these lines in it."""
    return text.replace('LINES', lines)


ANSWERS = {
    1: {
        'wrong': [
            with_lines(
                NEAREST,
                'for (float r : scan.ranges) {found = std::min(r, found);}  // 0.0 counts',
            ),
            with_lines(
                NEAREST,
                'found = *std::min_element(scan.ranges.begin(), scan.ranges.end());',
            ),
            with_lines(
                NEAREST,
                'for (float r : scan.ranges) {\n'
                '    if (r > scan.range_min) {found = std::min(found, r);}\n  }',
            ),
            with_lines(
                NEAREST,
                'for (float r : scan.ranges) {\n'
                '    if (r < scan.range_min || r > scan.range_max) {continue;}\n'
                '    found = std::min(r, found);\n  }\n  if (std::isnan(scan.ranges[0])) '
                '{found = scan.ranges[0];}',
            ),
            with_lines(
                NEAREST,
                'for (float r : scan.ranges) {\n'
                '    const bool in = r > scan.range_min && r < scan.range_max;\n'
                '    if (in) {found = std::min(found, r);}\n  }',
            ),
            with_lines(NEAREST, 'for (r : scan.ranges) {found = r}'),
        ],
        'right': [
            with_lines(
                NEAREST,
                'for (std::size_t i = 0; i < scan.ranges.size(); ++i) {\n'
                '    const float r = scan.ranges[i];\n'
                '    const bool valid = r >= scan.range_min && r <= scan.range_max;\n'
                '    if (valid && r < found) {found = r;}\n  }',
            ),
            with_lines(
                NEAREST,
                'for (const auto r : scan.ranges) {\n'
                '    if (std::isnan(r) || r < scan.range_min || r > scan.range_max) {continue;}\n'
                '    found = std::min(found, r);\n  }',
            ),
            with_lines(
                NEAREST,
                'for (auto it = scan.ranges.begin(); it != scan.ranges.end(); ++it) {\n'
                '    const bool valid = *it >= scan.range_min && !(*it > scan.range_max);\n'
                '    found = valid && *it < found ? *it : found;\n  }',
            ),
        ],
    },
    2: {
        'wrong': [
            with_lines(WATCHER_CMAKE, FOUND + LINKED),
            with_lines(WATCHER_CMAKE, FOUND + INSTALLED),
            with_lines(
                WATCHER_CMAKE,
                FOUND.replace('find_package(small_rclcpp REQUIRED)\n', '') + LINKED + INSTALLED,
            ),
            with_lines(
                WATCHER_CMAKE, FOUND.replace('src/watcher.cpp', 'watcher.cpp') + LINKED + INSTALLED
            ),
            with_lines(
                WATCHER_CMAKE, FOUND + LINKED + 'install(TARGETS watcher DESTINATION bin)\n'
            ),
        ],
        'right': [
            with_lines(WATCHER_CMAKE, FOUND + LINKED + INSTALLED),
            with_lines(
                WATCHER_CMAKE,
                FOUND
                + 'target_link_libraries(watcher scan_tools::scan_tools)\n'
                + 'target_link_libraries(watcher small_rclcpp::small_rclcpp ${std_msgs_TARGETS})\n'
                + 'install(TARGETS watcher RUNTIME DESTINATION lib/watcher)\n',
            ),
            with_lines(
                WATCHER_CMAKE,
                FOUND + 'ament_target_dependencies(watcher scan_tools small_rclcpp std_msgs)\n'
                'install(TARGETS\n  watcher\n  DESTINATION lib/${PROJECT_NAME})\n',
            ),
        ],
    },
    3: {
        'wrong': [
            with_lines(
                BRAKE, 'twist.linear.x = distance < 0.7 ? 0.2 : distance < 0.4 ? 0.0 : 0.5;'
            ),
            with_lines(BRAKE, GOOD).replace('publisher_->publish(twist);', ''),
            with_lines(BRAKE, 'if (distance < 0.4) {twist.linear.x = 0.5;}').replace(
                '      });', '        publisher_->publish(twist);\n      });'
            ),
            with_lines(BRAKE, GOOD + '\n        publisher_->publish(twist);').replace(
                '"cmd_vel"', '"cmd_vel_"'
            ),
            with_lines(BRAKE, GOOD + '\n        publisher_->publish(twist);').replace(
                '  ros::spin(std::make_shared<Brake>());\n', '  Brake brake;\n'
            ),
            with_lines(BRAKE, GOOD + '\n        publisher_.publish(twist);'),
        ],
        'right': [
            with_lines(BRAKE, GOOD + '\n        publisher_->publish(twist);'),
            with_lines(
                BRAKE,
                'if (distance >= 0.7) {twist.linear.x = 0.5;}\n'
                '        else if (distance >= 0.4) {twist.linear.x = 0.2;}\n'
                '        publisher_->publish(twist);',
            ),
            with_lines(
                BRAKE,
                'twist.linear.x = 0.5;\n'
                '        if (distance < 0.7) {twist.linear.x = 0.2;}\n'
                '        if (distance < 0.4) {twist.linear.x = 0.0;}\n'
                '        publisher_->publish(twist);',
            ).replace(
                '  ros::spin(std::make_shared<Brake>());\n',
                '  const auto brake = std::make_shared<Brake>();\n  small_rclcpp::spin(brake);\n',
            ),
        ],
    },
    4: {
        'wrong': [
            "ARGUMENTS = '--ros-args -r __ns:=/blue'",
            "ARGUMENTS = ('-r', '__ns:=/blue')",
            "ARGUMENTS = ('--ros-args', '-r', 'scan:=/blue/scan')",
            "ARGUMENTS = ('--ros-args', '-r', 'scan:=/blue/scan', 'cmd_vel:=/blue/cmd_vel')",
            "ARGUMENTS = ('--ros-args', '-r', '__ns:=/blue/brake')",
            "ARGUMENTS = ('--ros-args', '-r', '__node:=blue')",
        ],
        'right': [
            "ARGUMENTS = ('--ros-args', '-r', 'scan:=/blue/scan', '-r', 'cmd_vel:=/blue/cmd_vel')",
            "ARGUMENTS = ['--ros-args', '--remap', '__ns:=/blue', '-r', '__node:=blue_brake']",
            "ARGUMENTS = '--ros-args -r __ns:=/blue'.split()",
        ],
    },
    5: {
        'wrong': [
            with_lines(
                SPIN,
                '  for (const auto & s : node->wait()) {\n'
                '    auto message = s->create_message();\n'
                '    if (s->take_type_erased(message.get())) {s->handle_message(message);}\n  }',
            ),
            with_lines(
                SPIN,
                '  while (small_rclcpp::ok()) {\n    for (const auto & s : node->wait()) {\n'
                '      auto message = s->create_message();\n      s->handle_message(message);\n'
                '    }\n  }',
            ),
            with_lines(
                SPIN,
                '  while (small_rclcpp::ok()) {\n    for (const auto & s : node->wait()) {\n'
                '      auto message = s->create_message();\n'
                '      s->take_type_erased(message.get());\n    }\n  }',
            ),
            with_lines(
                SPIN,
                '  while (true) {\n    for (const auto & s : node->wait()) {\n'
                '      auto message = s->create_message();\n'
                '      if (s->take_type_erased(message.get())) {s->handle_message(message);}\n'
                '    }\n  }',
            ),
            with_lines(
                SPIN,
                '  while (small_rclcpp::ok()) {\n    for (const auto & s : node->wait()) {\n'
                '      auto message = s->create_message();\n      s->handle_message(message);\n'
                '      s->take_type_erased(message.get());\n    }\n  }',
            ),
        ],
        'right': [
            with_lines(
                SPIN,
                '  while (small_rclcpp::ok()) {\n    for (auto subscription : node->wait()) {\n'
                '      auto message = subscription->create_message();\n'
                '      if (!subscription->take_type_erased(message.get())) {continue;}\n'
                '      subscription->handle_message(message);\n    }\n  }',
            ),
            with_lines(
                SPIN,
                '  while (small_rclcpp::ok()) {\n    const auto ready = node->wait();\n'
                '    for (std::size_t i = 0; i < ready.size(); ++i) {\n'
                '      std::shared_ptr<void> message = ready[i]->create_message();\n'
                '      const bool taken = ready[i]->take_type_erased(message.get());\n'
                '      if (taken) {ready[i]->handle_message(message);}\n    }\n  }',
            ),
            with_lines(
                SPIN,
                '  while (small_rclcpp::ok()) {\n    for (const auto & s : node->wait()) {\n'
                '      auto message = s->create_message();\n'
                '      while (s->take_type_erased(message.get())) {s->handle_message(message);}\n'
                '    }\n  }',
            ),
        ],
    },
}
