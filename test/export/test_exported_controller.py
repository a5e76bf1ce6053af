"""The exported controller is C++ that compiles and adds the compensation, against stand-ins for ros2_control's headers.

ros2_control has no package here that holds its headers: the stand-ins follow the public interface of Jazzy, and
building against the real one is left to the machine that will run it (docs/export.md says so).
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
#include <memory>
#include <string>
#include <vector>
namespace rclcpp { struct Time { long long ns; long long nanoseconds() const { return ns; } }; struct Duration {}; }
namespace rclcpp_lifecycle { struct State {}; struct LifecycleNode {
  const char * get_name() const { return "friction_compensation"; } }; }
namespace hardware_interface {
struct CommandInterface {
  std::string prefix, name; double * value;
  CommandInterface(const std::string & p, const std::string & n, double * v) : prefix(p), name(n), value(v) {} };
struct LoanedCommandInterface { double value = 0.0; bool set_value(double v) { value = v; return true; } };
struct LoanedStateInterface { double value = 0.0; double get_value() const { return value; } };
}
namespace controller_interface {
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration { interface_configuration_type type; std::vector<std::string> names = {}; };
class ChainableControllerInterface {
public:
  virtual ~ChainableControllerInterface() = default;
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
  virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() = 0;
  virtual bool on_set_chained_mode(bool) { return true; }
  virtual return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  virtual return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  std::vector<double> reference_interfaces_;
private:
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
HEADERS = (
    "controller_interface/chainable_controller_interface.hpp", "hardware_interface/handle.hpp", "rclcpp/time.hpp",
    "rclcpp/duration.hpp", "rclcpp_lifecycle/state.hpp",
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
    manager = yaml.safe_load(files["config/controllers.yaml"])["controller_manager"]["ros__parameters"]
    assert manager["update_rate"] == 1000
    assert manager["friction_compensation"]["type"] == kind.get("name")


@needs("gcc", "g++")
def test_the_controller_adds_the_compensation(tmp_path: Path) -> None:
    """Two axes, one of them counted backwards and in thousandths: both get the same compensation in their own units."""
    other = replace(AXIS, name="y", position_scale=1.0, effort_scale=-1e-3)
    package((AXIS, other), tmp_path)
    for header in HEADERS:
        path = tmp_path / "stand_in" / header
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STAND_IN if header == HEADERS[0] else f'#pragma once\n#include "{HEADERS[0]}"\n')
    plugin = tmp_path / "stand_in" / "pluginlib" / "class_list_macros.hpp"
    plugin.parent.mkdir()
    plugin.write_text("#pragma once\n#define PLUGINLIB_EXPORT_CLASS(a, b)\n")
    (tmp_path / "main.cpp").write_text(MAIN)
    common = ["-Wall", "-Wextra", "-Werror", "-Isrc", "-Iinclude", "-Istand_in"]
    for command in (
        ["gcc", "-std=c99", "-c", "-Wall", "-Wextra", "-Werror", "-o", "sgms.o", "src/sgms.c"],
        ["g++", "-std=c++17", *common, "-o", "run", "main.cpp", "src/friction_compensation.cpp", "sgms.o", "-lm"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    lines = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout.splitlines()
    rows = [(line.split()[0], float(line.split()[1]), float(line.split()[2])) for line in lines]
    x = [(wanted, sent) for name, wanted, sent in rows if name == "x/effort"]
    y = [(wanted, sent) for name, wanted, sent in rows if name == "y/effort"]
    assert len(x) == len(y) == 8
    added = [sent - wanted for wanted, sent in x]
    assert max(abs(force) for force in added) > 2.0  # N of 4 N Coulomb friction
    assert [force > 0.0 for force in added[2:6]] != [force > 0.0 for force in added[3:7]]  # it turns with the motion
    for force, (wanted, sent) in zip(added, y, strict=True):
        assert (sent - wanted) * -1e-3 == pytest.approx(force, abs=0.5)
