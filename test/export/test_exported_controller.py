"""The exported controller is C++ that compiles and adds the compensation, against stand-ins for ros2_control's headers.

ros2_control has no package here that holds its headers: the stand-ins have the signatures of ros2_control 4.27 to 4.46
(Jazzy), with what is deprecated there, of all that the controller calls or overrides. docs/export.md says what was
checked against the real ones.
"""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from c_build import needs

from sgms_observer.export.c_target import PACKAGE, c_files, controller_files
from sgms_observer.settings.axis import AxisSettings, CompensationSettings, EstimatorSettings, Settings

AXIS = AxisSettings(estimator=EstimatorSettings(kind="ekf"), compensation=CompensationSettings(enabled=True, gain=1.0))

STAND_IN = """#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>
namespace rcl_interfaces { namespace msg {
struct FloatingPointRange { double from_value = 0.0, to_value = 0.0, step = 0.0; };
struct SetParametersResult { bool successful = false; std::string reason; };
struct ParameterDescriptor { std::string description; std::vector<FloatingPointRange> floating_point_range; };
} }
namespace rclcpp {
struct Time { std::int64_t ns; std::int64_t nanoseconds() const { return ns; } }; struct Duration {};
struct Logger {};
struct Parameter { std::string name; double value;
  const std::string & get_name() const { return name; }
  bool as_bool() const { return value != 0.0; }
  double as_double() const { return value; } };
}
#define RCLCPP_ERROR(logger, ...) ((void)(logger), std::printf(__VA_ARGS__))
#define RCLCPP_WARN(logger, ...) ((void)(logger), std::fprintf(stderr, __VA_ARGS__))
namespace rclcpp_lifecycle { struct State {}; class LifecycleNode {
public:
  struct OnSetParametersCallbackHandle { using SharedPtr = std::shared_ptr<OnSetParametersCallbackHandle>; };
  using OnSetParametersCallbackType =
    std::function<rcl_interfaces::msg::SetParametersResult(const std::vector<rclcpp::Parameter> &)>;
  struct PostSetParametersCallbackHandle { using SharedPtr = std::shared_ptr<PostSetParametersCallbackHandle>; };
  using PostSetParametersCallbackType = std::function<void(const std::vector<rclcpp::Parameter> &)>;
  const char * get_name() const { return "friction_compensation"; }
  rclcpp::Logger get_logger() const { return {}; }
  template<typename T> T declare_parameter(
    const std::string & name, const T & value, const rcl_interfaces::msg::ParameterDescriptor & descriptor) {
    declared[name] = descriptor; values[name] = static_cast<double>(value); return value; }
  [[nodiscard]] OnSetParametersCallbackHandle::SharedPtr add_on_set_parameters_callback(
    OnSetParametersCallbackType callback) {
    before_ = callback;
    auto handle = std::make_shared<OnSetParametersCallbackHandle>(); kept_before_ = handle; return handle; }
  [[nodiscard]] PostSetParametersCallbackHandle::SharedPtr add_post_set_parameters_callback(
    PostSetParametersCallbackType callback) {
    after_ = callback;
    auto handle = std::make_shared<PostSetParametersCallbackHandle>(); kept_after_ = handle; return handle; }
  std::string set(const std::string & name, double value) {  // as rclcpp: no handle, no callback
    const std::vector<rclcpp::Parameter> parameters{{name, value}};
    if (!kept_before_.expired()) {
      const auto result = before_(parameters);
      if (!result.successful) return result.reason;
    }
    if (!kept_after_.expired()) after_(parameters);
    return "";
  }
  std::map<std::string, rcl_interfaces::msg::ParameterDescriptor> declared;
  std::map<std::string, double> values;
private:
  OnSetParametersCallbackType before_;
  PostSetParametersCallbackType after_;
  std::weak_ptr<OnSetParametersCallbackHandle> kept_before_;
  std::weak_ptr<PostSetParametersCallbackHandle> kept_after_;
}; }
namespace hardware_interface {
struct CommandInterface {
  std::string prefix, name; double * value;
  [[deprecated("Use InterfaceDescription for initializing the Interface")]]
  CommandInterface(const std::string & p, const std::string & n, double * v) : prefix(p), name(n), value(v) {}
  CommandInterface(const CommandInterface &) = delete;
  CommandInterface(CommandInterface &&) = default;
};
struct Loaned {
  double value = 0.0;
  bool is_busy = false;  // another thread holds the lock of the interface
  Loaned() = default;
  Loaned(const Loaned &) = delete;
  Loaned(Loaned &&) = default;
  [[deprecated("Use std::optional<T> get_optional() instead to retrieve the value.")]]
  double get_value() const { return value; }
  template<typename T = double> [[nodiscard]] std::optional<T> get_optional(unsigned int = 10) const {
    return is_busy ? std::nullopt : std::optional<T>(value); }
};
struct LoanedCommandInterface : Loaned {
  double limit = INFINITY;  // of the robot description
  template<typename T> [[nodiscard]] bool set_value(const T & v, unsigned int = 10) {
    if (is_busy) return false;
    value = std::clamp(v, -limit, limit); return true; }
};
struct LoanedStateInterface : Loaned {};
}
namespace controller_interface {
enum class CallbackReturn : std::uint8_t { SUCCESS, FAILURE, ERROR };
enum class return_type : std::uint8_t { OK, ERROR };
enum class interface_configuration_type : std::uint8_t { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration {
  interface_configuration_type type = interface_configuration_type::NONE; std::vector<std::string> names = {}; };
class ChainableControllerInterface {
public:
  virtual ~ChainableControllerInterface() = default;
  bool set_chained_mode(bool chained) {
    if (!on_set_chained_mode(chained)) return false;
    is_chained_ = chained; return true; }
  bool is_in_chained_mode() const { return is_chained_; }
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;
  return_type cycle(long long ns) { return update_and_write_commands(rclcpp::Time{ns}, rclcpp::Duration{}); }
  std::vector<hardware_interface::CommandInterface> offer() { return on_export_reference_interfaces(); }
protected:
  [[deprecated("Replaced by on_export_reference_interfaces_list() method.")]]  // since 4.44, which is too new to need
  virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() { return {}; }
  virtual bool on_set_chained_mode(bool) { return true; }
  virtual return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  virtual return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  std::vector<double> reference_interfaces_;
private:
  bool is_chained_ = false;
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};
}
"""
MAIN = """#include <cmath>
#include <cstdio>
#include "sgms_friction_compensation/friction_compensation.hpp"
int main() {
  sgms_friction_compensation::FrictionCompensation controller;
  controller.on_init();
  controller.set_chained_mode(true);
  auto offered = controller.offer();
  const size_t joints = controller.command_interface_configuration().names.size();
  controller.command_interfaces_.resize(joints);
  controller.state_interfaces_.resize(controller.state_interface_configuration().names.size());
  controller.on_activate(rclcpp_lifecycle::State{});
  for (int k = 0; k < 4000; ++k) {
    const double t = 1e-3 * k, rate = 2 * 3.14159265358979 * 0.5, q = 1e-3 * std::sin(rate * t);
    for (size_t i = 0; i < joints; ++i) {
      controller.state_interfaces_[i].value = q;
      *offered[3 * i].value = -rate * rate * q * 10.0;
      *offered[3 * i + 1].value = q;
      *offered[3 * i + 2].value = rate * 1e-3 * std::cos(rate * t);
    }
    controller.cycle(1000000000LL + 1000000LL * k);
    if (k % 500 == 250) {
      for (size_t i = 0; i < joints; ++i)
        std::printf("%s %.6f %.6f\\n", offered[3 * i].name.c_str(), *offered[3 * i].value,
                    controller.command_interfaces_[i].value);
    }
  }
}
"""
SWITCHED = """#include <cmath>
#include <cstdio>
#include "sgms_friction_compensation/friction_compensation.hpp"
using Controller = sgms_friction_compensation::FrictionCompensation;
static long long cycles = 0;
// Moves the axes for two periods and prints the largest effort that the controller added to each joint in the second.
static void move(
  const char * what, Controller & controller, std::vector<hardware_interface::CommandInterface> & offered) {
  double largest[2] = {0.0, 0.0};
  for (int k = 0; k < 2000; ++k, ++cycles) {
    const double t = 1e-3 * k, rate = 2 * 3.14159265358979, q = 1e-3 * std::sin(rate * t);
    for (size_t i = 0; i < 2; ++i) {
      controller.state_interfaces_[i].value = q;
      *offered[3 * i].value = -rate * rate * q * 10.0;
      *offered[3 * i + 1].value = q;
      *offered[3 * i + 2].value = rate * 1e-3 * std::cos(rate * t);
    }
    controller.cycle(1000000000LL + 1000000LL * cycles);
    for (size_t i = 0; i < 2 && k >= 1000; ++i)
      largest[i] = std::fmax(largest[i], std::fabs(controller.command_interfaces_[i].value - *offered[3 * i].value));
  }
  std::printf("%s %.6f %.6f\\n", what, largest[0], largest[1]);
}
int main() {
  Controller controller;
  controller.on_init();
  controller.set_chained_mode(true);
  auto offered = controller.offer();
  controller.command_interfaces_.resize(2);
  controller.state_interfaces_.resize(2);
  auto node = controller.get_node();
  for (const auto & [name, value] : node->values) {
    const auto & range = node->declared[name].floating_point_range;
    std::printf("%s %.6f %.6f\\n", name.c_str(), value, range.empty() ? -1.0 : range[0].to_value);
  }
  controller.on_configure(rclcpp_lifecycle::State{});
  controller.on_activate(rclcpp_lifecycle::State{});
  move("start", controller, offered);
  node->set("x.compensation.enabled", 1.0);
  move("enabled", controller, offered);
  node->set("x.compensation.gain", 0.45);
  move("half", controller, offered);
  std::printf("refused %d 0\\n", node->set("x.compensation.gain", NAN).find("must be a number") != std::string::npos);
  move("no_number", controller, offered);
  node->set("x.compensation.enabled", 0.0);
  move("fading", controller, offered);
  move("disabled", controller, offered);
  node->set("x.compensation.enabled", 1.0);
  move("again", controller, offered);
  controller.on_deactivate(rclcpp_lifecycle::State{});
  for (size_t i = 0; i < 2; ++i) {
    std::printf("deactivated %.6f %.6f\\n", controller.command_interfaces_[i].value, *offered[3 * i].value);
    std::printf("set_point %d %d\\n", std::isnan(*offered[3 * i + 1].value), std::isnan(*offered[3 * i + 2].value));
    *offered[3 * i].value = 5.0;  // a command from before the activation
  }
  controller.on_activate(rclcpp_lifecycle::State{});
  controller.cycle(1000000000LL + 1000000LL * cycles++);
  std::printf("first %.6f %.6f\\n", controller.command_interfaces_[0].value, controller.command_interfaces_[1].value);
  move("activated", controller, offered);
}
"""
LIMITED = """#include <cmath>
#include <cstdio>
#include "sgms_friction_compensation/friction_compensation.hpp"
// A controller before that asks for more than the axis may get; then the limit is gone, and the compensation is alone.
int main() {
  const double cases[][2] = {{10.0, 3.0}, {1000.0, 3.0}, {1000.0, 4.5}};
  for (const auto & [wanted, limit] : cases) {
    sgms_friction_compensation::FrictionCompensation controller;
    controller.on_init();
    controller.set_chained_mode(true);
    auto offered = controller.offer();
    controller.command_interfaces_.resize(1);
    controller.state_interfaces_.resize(1);
    controller.on_activate(rclcpp_lifecycle::State{});
    auto & command = controller.command_interfaces_[0];
    for (int k = 0; k < 1200; ++k) {
      const double t = 1e-3 * k, rate = 2 * 3.14159265358979 * 0.5;
      controller.state_interfaces_[0].value = 1e-3 * std::sin(rate * t);
      command.limit = k < 1199 ? limit : INFINITY;
      command.is_busy = k >= 1100 && k < 1110;
      *offered[0].value = k < 1199 ? std::copysign(wanted, std::cos(rate * t)) : 0.0;
      controller.cycle(1000000000LL + 1000000LL * k);
    }
    std::printf("%.0f %.1f %.9f\\n", wanted, limit, command.value);
  }
}
"""
ALONE = """#include <cmath>
#include <cstdio>
#include "sgms_friction_compensation/friction_compensation.hpp"
// The controller before is there, then it is gone, then the user allows the compensation to act alone.
int main() {
  sgms_friction_compensation::FrictionCompensation controller;
  controller.on_init();
  auto offered = controller.offer();
  controller.command_interfaces_.resize(1);
  controller.state_interfaces_.resize(1);
  long long cycles = 0;
  for (const char * step : {"chained", "alone", "allowed"}) {
    controller.set_chained_mode(step[0] == 'c');
    if (step[2] == 'l') controller.get_node()->set("may_act_alone", 1.0);
    controller.on_activate(rclcpp_lifecycle::State{});
    double largest = 0.0;
    for (int k = 0; k < 4000; ++k) {
      const double t = 1e-3 * k, rate = 2 * 3.14159265358979 * 0.5;
      controller.state_interfaces_[0].value = 1e-3 * std::sin(rate * t);
      controller.cycle(1000000000LL + 1000000LL * cycles++);
      largest = std::fmax(largest, std::fabs(controller.command_interfaces_[0].value));
    }
    std::printf("%s %.6f 0\\n", step, largest);
  }
}
"""
HEADERS = (
    "controller_interface/chainable_controller_interface.hpp", "hardware_interface/handle.hpp", "rclcpp/time.hpp",
    "rclcpp/duration.hpp", "rclcpp/logging.hpp", "rclcpp/parameter.hpp", "rclcpp_lifecycle/state.hpp",
    "rclcpp_lifecycle/lifecycle_node.hpp", "rcl_interfaces/msg/parameter_descriptor.hpp",
    "rcl_interfaces/msg/set_parameters_result.hpp",
)  # fmt: skip


def package(axes: tuple[AxisSettings, ...], folder: Path) -> dict[str, str]:
    """Write the controller's package and return its files."""
    settings = Settings(axes=axes, sample_period=1e-3)
    files = controller_files(axes, c_files(settings, axes, "double")[0], settings.sample_period)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return files


def test_names_in_the_package_agree(tmp_path: Path) -> None:
    files = package((AXIS,), tmp_path)
    assert ET.fromstring(files["package.xml"]).findtext("name") == PACKAGE
    plugin = ET.fromstring(files[f"{PACKAGE}.xml"])
    kind = plugin.find("class")
    assert kind is not None
    assert plugin.get("path") == PACKAGE
    assert kind.get("type") == f"{PACKAGE}::FrictionCompensation"
    assert f"PLUGINLIB_EXPORT_CLASS({PACKAGE}::FrictionCompensation" in files["src/friction_compensation.cpp"]
    document = yaml.safe_load(files["config/controllers.yaml"])
    manager = document["/**/controller_manager"]["ros__parameters"]
    assert manager["update_rate"] == 1000
    own = document["/**/friction_compensation"]["ros__parameters"]
    assert manager["friction_compensation"]["type"] == own["type"] == kind.get("name")
    assert own["x"] == {"compensation": {"enabled": True, "gain": 1.0}}  # of the parameter file


def run(axes: tuple[AxisSettings, ...], program: str, tmp_path: Path) -> list[tuple[str, float, float]]:
    """Build the controller of these axes with a program around it, and return the name and two numbers of each line."""
    package(axes, tmp_path)
    for header in HEADERS:
        path = tmp_path / "stand_in" / header
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STAND_IN if header == HEADERS[0] else f'#pragma once\n#include "{HEADERS[0]}"\n')
    plugin = tmp_path / "stand_in" / "pluginlib" / "class_list_macros.hpp"
    plugin.parent.mkdir()
    plugin.write_text("#pragma once\n#define PLUGINLIB_EXPORT_CLASS(a, b)\n")
    (tmp_path / "main.cpp").write_text(program)
    common = ["-Wall", "-Wextra", "-Werror", "-Isrc", "-Iinclude", "-isystem", "stand_in"]
    for command in (
        ["gcc", "-std=c99", "-c", "-Wall", "-Wextra", "-Werror", "-o", "sgms.o", "src/sgms.c"],
        ["g++", "-std=c++17", *common, "-o", "run", "main.cpp", "src/friction_compensation.cpp", "sgms.o", "-lm"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    lines = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout.splitlines()
    return [(line.split()[0], float(line.split()[1]), float(line.split()[2])) for line in lines]


@needs("gcc", "g++")
def test_the_controller_adds_the_compensation(tmp_path: Path) -> None:
    """Two axes, one of them counted backwards and in thousandths: both get the same compensation in their own units."""
    other = replace(AXIS, name="y", position_scale=1.0, effort_scale=-1e-3)
    rows = run((AXIS, other), MAIN, tmp_path)
    x = [(wanted, sent) for name, wanted, sent in rows if name == "x/effort"]
    y = [(wanted, sent) for name, wanted, sent in rows if name == "y/effort"]
    assert len(x) == len(y) == 8
    added = [sent - wanted for wanted, sent in x]
    assert max(abs(force) for force in added) > 2.0  # N of 4 N Coulomb friction
    assert [force > 0.0 for force in added[2:6]] != [force > 0.0 for force in added[3:7]]  # it turns with the motion
    for force, (wanted, sent) in zip(added, y, strict=True):
        assert (sent - wanted) * -1e-3 == pytest.approx(force, abs=0.5)


@needs("gcc", "g++")
def test_it_is_switched_while_it_runs_and_leaves_no_effort(tmp_path: Path) -> None:
    """Parameters named as those of the observer node, starting with the values of the parameter file."""
    off = replace(AXIS, compensation=CompensationSettings(enabled=False, gain=0.9))
    rows = run((off, replace(off, name="y")), SWITCHED, tmp_path)
    said = {name: (first, second) for name, first, second in rows}
    for joint in ("x", "y"):
        assert said[f"{joint}.compensation.enabled"] == (0.0, -1.0)
        assert said[f"{joint}.compensation.gain"] == (0.9, 1.0)  # value, largest allowed value
    assert said["start"] == (0.0, 0.0)
    assert said["enabled"][0] > 2.0  # N of 4 N Coulomb friction
    assert said["half"][0] == pytest.approx(said["enabled"][0] / 2.0, rel=0.1)
    assert said["refused"][0] == 1.0
    assert said["no_number"][0] == pytest.approx(said["half"][0], rel=1e-3)
    assert said["disabled"] == (0.0, 0.0)
    assert said["again"][0] == pytest.approx(said["half"][0], rel=0.1)
    assert [(first, second) for name, first, second in rows if name == "deactivated"] == [(0.0, 0.0)] * 2
    assert [(first, second) for name, first, second in rows if name == "set_point"] == [(1.0, 1.0)] * 2
    assert said["first"] == (0.0, 0.0)
    assert said["activated"][0] == pytest.approx(said["half"][0], rel=0.1)  # the parameter still holds
    assert all(said[name][1] == 0.0 for name in ("enabled", "half", "again", "activated"))  # y was never switched on


@needs("gcc", "g++")
def test_the_observer_is_told_the_effort_that_the_axis_gets(tmp_path: Path) -> None:
    """Where ros2_control limits the effort, or cannot set it, what was asked for counts for nothing."""
    estimator = EstimatorSettings(kind="ekf", parameters=("coulomb_force",), correction_every=2, parameter_walk=0.1)
    (_, _, small), (_, _, large), (_, _, higher) = run((replace(AXIS, estimator=estimator),), LIMITED, tmp_path)
    assert small == large
    assert small == pytest.approx(-3.0, abs=0.1)  # N: as much as moved the axis; it accelerates with 0.06 N
    assert higher == pytest.approx(-4.5, abs=0.1)


@needs("gcc", "g++")
def test_without_a_controller_before_it_gives_no_effort_unless_allowed(tmp_path: Path) -> None:
    """ros2_control restarts it so when the controller before is deactivated, and nothing else would stop the axis."""
    said = {name: effort for name, effort, _ in run((AXIS,), ALONE, tmp_path)}
    assert said["alone"] == 0.0
    assert min(said["chained"], said["allowed"]) > 2.0  # N of 4 N Coulomb friction
