// The node: parameters and messages of ROS 2 around contact_estimator.
#include <chrono>
#include <fstream>
#include <iterator>
#include <memory>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/joint_state.hpp>
#include <std_msgs/msg/bool.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "contact_estimator.hpp"

namespace {

using joint_state = sensor_msgs::msg::JointState;
using names = std::vector<std::string>;

tendonfmu::finger load_finger(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file.is_open() || text.empty()) {
    throw std::runtime_error("description: " + path + ": cannot read it, or it is empty");
  }
  auto finger = tendonfmu::finger::from_json(text);
  if (!finger) {
    throw std::runtime_error("description: " + path + ": " + finger.message());
  }
  return *std::move(finger);
}

class contact_node : public rclcpp::Node {
 public:
  contact_node() : Node("contact_node"), estimator_(make_estimator()) {
    torque_.name = get_parameter("joint_names").as_string_array();
    torque_publisher_ = create_publisher<joint_state>("compensated_torque", 10);  // reliable: fits every subscriber
    contact_publisher_ = create_publisher<std_msgs::msg::Bool>("contact", 10);
    // Room for bursts: a message that is lost is a gap in the samples.
    subscription_ =
        create_subscription<joint_state>("tendon_states", rclcpp::SensorDataQoS().keep_last(100),
                                         [this](const joint_state::ConstSharedPtr& message) { take(*message); });
    timer_ = create_wall_timer(std::chrono::milliseconds(100), [this] { watch(); });
  }

 private:
  contact_estimator make_estimator() {
    contact_estimator::settings chosen;
    chosen.tendon_names = declare_parameter("tendon_names", names());
    chosen.joints = declare_parameter("joint_names", names()).size();
    chosen.longest_gap = declare_parameter("longest_gap", chosen.longest_gap);
    chosen.restart_after = declare_parameter("restart_after", chosen.restart_after);
    return contact_estimator(load_finger(declare_parameter("description", std::string())), chosen);
  }

  void take(const joint_state& message) {
    const rclcpp::Time stamp(message.header.stamp);
    const outcome found = estimator_.take({stamp.nanoseconds(), message.name, message.effort, message.position});
    if (found != outcome::taken) {
      RCLCPP_WARN_THROTTLE(get_logger(), *get_clock(), 1000, "tendon_states: %s", estimator_.reason().c_str());
    }
    if (found == outcome::refused || found == outcome::repeated) {
      return;
    }
    const tendonfmu::span<const double> torque = estimator_.compensated_torque();
    torque_.header = message.header;
    torque_.effort.assign(torque.begin(), torque.end());
    torque_publisher_->publish(torque_);
    contact_.data = estimator_.contact();
    contact_publisher_->publish(contact_);
  }

  void watch() {
    const std::int64_t now =
        std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
            .count();
    if (!estimator_.watch(now)) {
      RCLCPP_WARN_THROTTLE(get_logger(), *get_clock(), 1000, "tendon_states: %s", estimator_.reason().c_str());
    }
  }

  contact_estimator estimator_;
  joint_state torque_;
  std_msgs::msg::Bool contact_;
  rclcpp::Publisher<joint_state>::SharedPtr torque_publisher_;
  rclcpp::Publisher<std_msgs::msg::Bool>::SharedPtr contact_publisher_;
  rclcpp::Subscription<joint_state>::SharedPtr subscription_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace

int main(int count, char** arguments) {
  rclcpp::init(count, arguments);
  int status = 0;
  try {
    rclcpp::spin(std::make_shared<contact_node>());
  } catch (const std::exception& caught) {
    RCLCPP_FATAL(rclcpp::get_logger("contact_node"), "%s", caught.what());
    status = 1;
  }
  rclcpp::shutdown();
  return status;
}
