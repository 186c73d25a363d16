"""The panels: functions that draw a part of the window from a `PanelContext` and return the user's actions. They change
nothing themselves; `ui.action_handler` carries the actions out."""
