// A very small rclcpp for the lessons: nodes with publishers, subscriptions and timers, over the same
// rcl.
// What is here has the names and the arguments of rclcpp in Jazzy. What is not here: all the rest.
#pragma once

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <builtin_interfaces/msg/time.hpp>
#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rosidl_typesupport_cpp/message_type_support.hpp>

namespace small_rclcpp
{

// Functions of rcl return a number. Throws for any but "all is well".
inline void check(rcl_ret_t result)
{
  if (result != RCL_RET_OK) {
    const std::string error = rcl_get_error_string().str;
    rcl_reset_error();
    throw std::runtime_error(error);
  }
}

inline rcl_context_t context = rcl_get_zero_initialized_context();
inline volatile std::sig_atomic_t interrupted = 0;

inline void init(int argc, char ** argv)
{
  auto options = rcl_get_zero_initialized_init_options();
  check(rcl_init_options_init(&options, rcl_get_default_allocator()));
  check(rcl_init(argc, argv, &options, &context));
  check(rcl_init_options_fini(&options));
  std::signal(SIGINT, [](int) {interrupted = 1;});
  std::signal(SIGTERM, [](int) {interrupted = 1;});
}

inline bool ok() {return interrupted == 0;}

// The context itself stays until the process ends: nodes may still be there, as in rclcpp.
inline void shutdown() {check(rcl_shutdown(&context));}

// The rcl_node_t ends when nobody holds it any more: the node, its publishers, its subscriptions.
using Handle = std::shared_ptr<rcl_node_t>;

template<class Message>
class Publisher
{
public:
  using SharedPtr = std::shared_ptr<Publisher<Message>>;

  Publisher(const Handle & node, const std::string & topic, std::size_t depth)
  : node_(node)
  {
    auto options = rcl_publisher_get_default_options();  // RELIABLE, KEEP_LAST
    options.qos.depth = depth;
    const auto * type = rosidl_typesupport_cpp::get_message_type_support_handle<Message>();
    check(rcl_publisher_init(&publisher_, node_.get(), type, topic.c_str(), &options));
  }

  ~Publisher()
  {
    if (rcl_publisher_fini(&publisher_, node_.get()) != RCL_RET_OK) {rcl_reset_error();}
  }

  void publish(const Message & message) {check(rcl_publish(&publisher_, &message, nullptr));}

  // Waits until all subscriptions have what was published. Returns false if that takes longer.
  bool wait_for_all_acked(std::chrono::milliseconds timeout)
  {
    const auto result = rcl_publisher_wait_for_all_acked(
      &publisher_, RCL_MS_TO_NS(timeout.count()));
    if (result == RCL_RET_TIMEOUT) {
      rcl_reset_error();
      return false;
    }
    check(result);
    return true;
  }

private:
  Handle node_;
  rcl_publisher_t publisher_ = rcl_get_zero_initialized_publisher();
};

// A subscription of any type: what an executor needs of it.
class SubscriptionBase
{
public:
  using SharedPtr = std::shared_ptr<SubscriptionBase>;

  explicit SubscriptionBase(const Handle & node)
  : node_(node) {}

  virtual ~SubscriptionBase()
  {
    if (rcl_subscription_fini(&subscription_, node_.get()) != RCL_RET_OK) {rcl_reset_error();}
  }

  // Returns an empty message.
  virtual std::shared_ptr<void> create_message() = 0;
  // Calls the callback with a message.
  virtual void handle_message(std::shared_ptr<void> & message) = 0;

  // Takes the oldest message out of the queue. Returns whether there was one.
  bool take_type_erased(void * message)
  {
    const auto result = rcl_take(&subscription_, message, nullptr, nullptr);
    if (result == RCL_RET_SUBSCRIPTION_TAKE_FAILED) {
      rcl_reset_error();
      return false;
    }
    check(result);
    return true;
  }

protected:
  friend class Node;
  Handle node_;
  rcl_subscription_t subscription_ = rcl_get_zero_initialized_subscription();
};

template<class Message>
class Subscription : public SubscriptionBase
{
public:
  using SharedPtr = std::shared_ptr<Subscription<Message>>;
  using Callback = std::function<void (const Message &)>;

  Subscription(
    const Handle & node, const std::string & topic, std::size_t depth, Callback callback)
  : SubscriptionBase(node), callback_(std::move(callback))
  {
    auto options = rcl_subscription_get_default_options();
    options.qos.depth = depth;
    const auto * type = rosidl_typesupport_cpp::get_message_type_support_handle<Message>();
    check(rcl_subscription_init(&subscription_, node_.get(), type, topic.c_str(), &options));
  }

  std::shared_ptr<void> create_message() override {return std::make_shared<Message>();}

  void handle_message(std::shared_ptr<void> & message) override
  {
    callback_(*static_cast<const Message *>(message.get()));
  }

private:
  Callback callback_;
};

class Duration
{
public:
  explicit Duration(std::int64_t nanoseconds)
  : nanoseconds_(nanoseconds) {}

  std::int64_t nanoseconds() const {return nanoseconds_;}
  double seconds() const {return 1e-9 * nanoseconds_;}

private:
  std::int64_t nanoseconds_;
};

// A time of the clock that stamps have.
class Time
{
public:
  explicit Time(std::int64_t nanoseconds)
  : nanoseconds_(nanoseconds) {}
  Time(const builtin_interfaces::msg::Time & stamp)  // NOLINT: a stamp may stand for a Time
  : nanoseconds_(1'000'000'000LL * stamp.sec + stamp.nanosec) {}

  Duration operator-(const Time & other) const
  {
    return Duration(nanoseconds_ - other.nanoseconds_);
  }
  std::int64_t nanoseconds() const {return nanoseconds_;}
  double seconds() const {return 1e-9 * nanoseconds_;}

private:
  std::int64_t nanoseconds_;
};

class TimerBase
{
public:
  using SharedPtr = std::shared_ptr<TimerBase>;
  using Clock = std::chrono::steady_clock;

  TimerBase(std::chrono::nanoseconds period, std::function<void ()> callback)
  : period_(period), callback_(std::move(callback)), due_(Clock::now() + period) {}

  std::chrono::nanoseconds time_until_trigger() const {return due_ - Clock::now();}

  void execute_callback()
  {
    due_ = std::max(due_ + period_, Clock::now());  // what was missed is not made up for
    callback_();
  }

private:
  std::chrono::nanoseconds period_;
  std::function<void ()> callback_;
  Clock::time_point due_;
};

class Node
{
public:
  using SharedPtr = std::shared_ptr<Node>;

  explicit Node(const std::string & name)
  : handle_(new rcl_node_t(rcl_get_zero_initialized_node()), [](rcl_node_t * node) {
        if (rcl_node_fini(node) != RCL_RET_OK) {rcl_reset_error();}
        delete node;
      })
  {
    const auto options = rcl_node_get_default_options();
    check(rcl_node_init(handle_.get(), name.c_str(), "", &context, &options));
  }

  virtual ~Node() = default;

  template<class Message>
  auto create_publisher(const std::string & topic, std::size_t depth)
  {
    return std::make_shared<Publisher<Message>>(handle_, topic, depth);
  }

  template<class Message>
  auto create_subscription(
    const std::string & topic, std::size_t depth, std::function<void (const Message &)> callback)
  {
    auto made = std::make_shared<Subscription<Message>>(handle_, topic, depth, callback);
    subscriptions_.push_back(made);
    return made;
  }

  auto create_wall_timer(std::chrono::nanoseconds period, std::function<void ()> callback)
  {
    auto made = std::make_shared<TimerBase>(period, callback);
    timers_.push_back(made);
    return made;
  }

  // The system's clock: there is no use_sim_time here.
  Time now() const
  {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return Time(std::chrono::nanoseconds(now).count());
  }

  // Waits until a subscription has a message or a timer is due, 0.1 s at most. Calls the timers that
  // are due, and returns the subscriptions that have a message.
  // (In rclcpp a WaitSet waits, and the executor calls both.)
  std::vector<SubscriptionBase::SharedPtr> wait()
  {
    std::chrono::nanoseconds limit = std::chrono::milliseconds(100);
    for (const auto & timer : held(timers_)) {
      if (timer->time_until_trigger().count() <= 0) {timer->execute_callback();}
      limit = std::clamp(timer->time_until_trigger(), std::chrono::nanoseconds(0), limit);
    }
    const auto subscriptions = held(subscriptions_);
    if (subscriptions.empty()) {  // rcl_wait refuses to wait for nothing
      std::this_thread::sleep_for(limit);
      return {};
    }
    auto wait_set = rcl_get_zero_initialized_wait_set();
    const auto allocator = rcl_get_default_allocator();
    check(rcl_wait_set_init(&wait_set, subscriptions.size(), 0, 0, 0, 0, 0, &context, allocator));
    for (const auto & subscription : subscriptions) {
      check(rcl_wait_set_add_subscription(&wait_set, &subscription->subscription_, nullptr));
    }
    const auto result = rcl_wait(&wait_set, limit.count());
    std::vector<SubscriptionBase::SharedPtr> ready;
    if (result == RCL_RET_TIMEOUT) {
      rcl_reset_error();
    } else {
      check(result);
      for (std::size_t i = 0; i < subscriptions.size(); ++i) {
        if (wait_set.subscriptions[i] != nullptr) {ready.push_back(subscriptions[i]);}
      }
    }
    check(rcl_wait_set_fini(&wait_set));
    return ready;
  }

private:
  // Returns those that somebody still holds: as in rclcpp, the node keeps none.
  template<class Part>
  static std::vector<std::shared_ptr<Part>> held(const std::vector<std::weak_ptr<Part>> & parts)
  {
    std::vector<std::shared_ptr<Part>> found;
    for (const auto & each : parts) {
      if (auto part = each.lock()) {found.push_back(part);}
    }
    return found;
  }

  Handle handle_;
  std::vector<std::weak_ptr<SubscriptionBase>> subscriptions_;
  std::vector<std::weak_ptr<TimerBase>> timers_;
};

// Waits, takes, calls, until Ctrl+C.
inline void spin(const Node::SharedPtr & node)
{
  while (ok()) {
    for (const auto & subscription : node->wait()) {
      auto message = subscription->create_message();
      if (subscription->take_type_erased(message.get())) {subscription->handle_message(message);}
    }
  }
}

}  // namespace small_rclcpp
