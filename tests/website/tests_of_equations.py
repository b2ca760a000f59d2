"""Function of docs/mathematics.md -> the test that goes red if its equation is
wrong.
"""

from __future__ import annotations

TESTS = {
    "skyarm.algebra.quaternion.Quaternion.rotation": (
        "tests/algebra/test_quaternions.py::test_the_rotation_of_a_quaternion_is_that_of_scipy"
    ),
    "skyarm.algebra.quaternion.Quaternion.derivative": (
        "tests/algebra/test_quaternions.py::test_the_derivative_is_the_limit_of_a_small_turn_in_body_axes"
    ),
    "skyarm.algebra.matrix.axis_rotation": (
        "tests/algebra/test_vectors_and_matrices.py::test_a_rotation_about_an_axis_is_that_of_scipy"
    ),
    "skyarm.dynamics.newton_euler.inverse_dynamics": (
        "tests/dynamics/test_dynamics_oracles.py::test_inverse_dynamics_is_that_of_the_oracle"
    ),
    "skyarm.dynamics.composite_body.mass_matrix": (
        "tests/dynamics/test_dynamics_oracles.py::test_mass_matrix_is_that_of_the_oracle"
    ),
    "skyarm.dynamics.articulated_body.forward_dynamics": (
        "tests/dynamics/test_dynamics_oracles.py::test_forward_dynamics_is_that_of_the_oracle"
    ),
    "skyarm.dynamics.energy.kinetic_energy": (
        "tests/dynamics/test_dynamics_oracles.py::test_energy_is_that_of_the_oracle"
    ),
    "skyarm.dynamics.energy.momentum": (
        "tests/dynamics/test_dynamics_oracles.py::test_centre_of_mass_and_momentum_are_those_of_the_oracle"
    ),
    "skyarm.dynamics.kinematics.jacobian_columns": (
        "tests/dynamics/test_dynamics_oracles.py::test_poses_and_jacobians_of_every_frame_are_those_of_the_oracle"
    ),
    "skyarm.dynamics.actuators.rotor.speed_after": (
        "tests/dynamics/actuators/test_rotor.py::test_a_rising_speed_lags_by_the_short_time_constant"
    ),
    "skyarm.dynamics.actuators.rotor.rotor_force": (
        "tests/dynamics/actuators/test_rotor.py::test_the_drag_torque_is_against_the_rotation"
    ),
    "skyarm.dynamics.actuators.mixer.make_mixer": (
        "tests/dynamics/actuators/test_allocation.py::test_the_inverse_is_the_pseudo_inverse"
    ),
    "skyarm.dynamics.actuators.drive.joint_force": (
        "tests/dynamics/actuators/test_joint_force.py::test_friction_by_hand"
    ),
    "skyarm.dynamics.body_drag.body_drag": (
        "tests/dynamics/test_body_drag.py::test_body_drag_by_hand"
    ),
    "skyarm.world.gust.Gust.at": (
        "tests/world/test_wind.py::test_one_minus_cosine_rises_smoothly_to_its_peak_and_back"
    ),
    "skyarm.world.dryden.step": (
        "tests/world/test_dryden.py::test_variance_is_the_intensity_squared_at_any_step"
    ),
    "skyarm.control.blocks.geometric.downward_acceleration": (
        "tests/control/test_control_properties.py::test_commanded_acceleration_points_down_in_hover_and_up_to_a_far_lower_target"
    ),
    "skyarm.control.blocks.geometric.desired_attitude": (
        "tests/control/test_control_properties.py::test_desired_attitude_is_a_rotation_with_thrust_up_and_nose_to_the_heading"
    ),
    "skyarm.control.blocks.geometric.attitude_error": (
        "tests/control/test_control_properties.py::test_attitude_error_is_the_sine_of_the_angle_along_the_axis"
    ),
    "skyarm.control.blocks.geometric.rate_error": (
        "tests/control/test_control_properties.py::test_the_corrected_rate_error_vanishes_where_the_attitude_error_stands_still"
    ),
    "skyarm.control.blocks.geometric.angular_acceleration": (
        "tests/control/test_control_properties.py::test_angular_acceleration_times_any_inertia_is_the_gains_torque"
    ),
    "skyarm.control.laws.paper.hybrid_computed_torque": (
        "tests/control/test_hybrid_computed_torque.py::test_each_form_is_pinocchios_inverse_dynamics_of_the_papers_accelerations"
    ),
    "skyarm.control.laws.paper.force_by_euler_rates": (
        "tests/control/test_hybrid_computed_torque.py::test_euler_form_and_body_form_agree"
    ),
    **{
        f"skyarm.dynamics.euler_coordinates.{name}": (
            "tests/paper/test_paper_equations.py::test_mass_coriolis_and_gravity_are_those_of_the_papers_8x8_form"
        )
        for name in ("mass_matrix", "coriolis_matrix", "gravity_vector")
    },
    "skyarm.control.laws.centroidal.com_tracking.thrust": (
        "tests/control/test_centroidal_parts.py::test_the_forces_derivatives_are_those_along_the_motion_that_the_thrust_makes"
    ),
    "skyarm.control.blocks.attitude.attitude": (
        "tests/control/test_centroidal_parts.py::test_desired_rate_and_acceleration_are_those_of_the_turning_attitude"
    ),
    "skyarm.control.laws.centroidal.tip_tasks.joint_accelerations": (
        "tests/control/test_centroidal_parts.py::test_joint_accelerations_give_the_tip_and_the_links_what_they_were_asked_for"
    ),
    "skyarm.control.laws.centroidal.torques.needed": (
        "tests/control/test_centroidal_parts.py::test_torques_give_the_wished_accelerations_to_pinocchios_free_vehicle"
    ),
    "skyarm.control.blocks.disturbance_observer.observe": (
        "tests/control/test_centroidal_law.py::test_the_observer_finds_a_constant_force_and_its_torque"
    ),
    "skyarm.control.laws.centroidal.adaptation.adapt": (
        "tests/control/test_centroidal_adaptation.py::test_the_mass_moves_by_the_normalised_gradient"
    ),
    "skyarm.control.blocks.extrapolation.extrapolate": (
        "tests/control/test_centroidal_parts.py::test_held_samples_of_a_quartic_are_continued_exactly"
    ),
    "skyarm.control.blocks.actuators.command_for": (
        "tests/control/test_centroidal_parts.py::test_the_inverted_lag_reaches_the_wanted_speed_within_one_period"
    ),
    "skyarm.control.blocks.prediction.predict_across": (
        "tests/control/test_centroidal_parts.py::test_the_prediction_is_what_mujoco_does_in_that_time"
    ),
    "skyarm.control.laws.published.guo.guo_center_of_inertia": (
        "tests/control/test_published_formulas.py::test_the_locked_body_turns_about_its_centre_as_wanted"
    ),
    "skyarm.control.laws.published.li.li_feedforward": (
        "tests/control/test_published_formulas.py::test_the_base_feed_forward_is_pinocchios_inverse_dynamics_of_the_reference"
    ),
    "skyarm.control.laws.published.bulut.bulut_computed_torque": (
        "tests/control/test_published_formulas.py::test_the_simplified_mass_matrix_is_pinocchios_without_its_blocks_of_translation"
    ),
    "skyarm.control.laws.published.kim.sliding_mode": (
        "tests/control/test_published_formulas.py::test_without_switching_and_adaptation_sliding_mode_is_the_pd_law_of_its_gains"
    ),
    "skyarm.control.laws.published.l1.adaptation": (
        "tests/control/test_published_formulas.py::test_piecewise_constant_adaptation_is_the_publications_matrix_formula"
    ),
    "skyarm.control.laws.published.indi.indi": (
        "tests/control/test_law_terms.py::test_every_signal_is_as_late_as_the_measurement_and_filtered_alike"
    ),
    "skyarm.control.blocks.filters.butterworth": (
        "tests/control/test_filters.py::test_the_filter_is_scipys_butterworth"
    ),
    "skyarm.control.laws.predictive.solver.policy": (
        "tests/control/test_predictive.py::test_the_recursion_solves_the_least_squares_problem_written_out_whole"
    ),
    "skyarm.plant.rigid_body.coupled_rk4": (
        "tests/plant/test_integrators.py::test_runge_kutta_is_of_fourth_order_while_rotors_lag"
    ),
    "skyarm.plant.mujoco_stages.StagedRungeKutta.advance": (
        "tests/plant/test_integrators.py::test_the_attitude_of_a_body_that_spins_fast_is_of_fourth_order"
    ),
    "skyarm.world.contact.material.Material.normal_force": (
        "tests/world/contact/test_material.py::test_the_normal_force_is_that_of_hunt_and_crossley_and_never_pulls"
    ),
    "skyarm.world.contact.material.Material.bristle_rate": (
        "tests/world/contact/test_material.py::test_a_bristle_bends_with_the_slip_and_then_slides_at_its_length"
    ),
    "skyarm.world.contact.material.Material.friction_force": (
        "tests/world/contact/test_material.py::test_friction_stands_against_the_slip_with_the_share_that_the_bristle_is_bent"
    ),
    "skyarm.log.metrics.score.score": (
        "tests/log/metrics/test_metrics.py::test_rms_of_attitude_and_torques"
    ),
    "skyarm.log.tip_positions.level_tip": (
        "tests/log/metrics/test_metrics.py::test_the_desired_tool_is_that_of_a_level_base_with_the_desired_heading"
    ),
    "skyarm.studies.stability.margins.margins": (
        "tests/studies/stability/test_margins.py::test_the_delay_margin_is_phase_margin_over_crossover"
    ),
    "skyarm.studies.stability.disk_margins.disk_of": (
        "tests/studies/stability/test_disk_margins.py::test_the_third_order_loop_of_the_books_has_its_published_disk_margin"
    ),
    "skyarm.studies.stability.disk_margins.upper_bound": (
        "tests/studies/stability/test_disk_margins.py::test_the_bound_is_the_structured_singular_value_of_up_to_three_numbers"
    ),
    "skyarm.studies.sweep.intervals.wilson": (
        "tests/studies/sweep/test_sweep_intervals.py::test_the_interval_of_a_share_is_that_of_an_independent_library"
    ),
    "skyarm.algebra.scalars.philox.philox4x32": (
        "tests/algebra/scalars/test_philox.py::test_known_answers_of_random123"
    ),
}
